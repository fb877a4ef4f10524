"""The base of every error of this product; all that a caller may catch are in `denseface` itself.

=========================== =======================================================================
`CaptureError`              between a sensor or file and a frame
`ReconstructionError`       a frame that does not become a face: the same for the same frame
`ServiceError`              between a press and a published face, and files of faces
`MissingPackageError`       an installation without what a call needs
=========================== =======================================================================

Each is also the builtin kind that a caller would expect to catch: `CalibrationError` is a
`ValueError`, `ClientTimeoutError` a `TimeoutError`. An argument of a wrong type is a plain
`TypeError`, and what the system refuses where a file is written an `OSError`.
"""

from typing import Any

__all__ = ["DensefaceError", "MissingPackageError"]


class DensefaceError(Exception):
    """Base of every error raised by denseface."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Come whole out of another process, whatever the parameters of `__init__`."""
        return _again, (type(self), self.args, self.__dict__)


class MissingPackageError(DensefaceError, ModuleNotFoundError):
    """A package is not installed that a call needs; the message names the extra that brings it."""


def _again(kind: type[DensefaceError], args: tuple[Any, ...], state: dict[str, Any]
           ) -> DensefaceError:
    # Of a kind with two builtin bases, Python finds the wrong one's `__new__` by itself.
    base = next((one for one in (OSError, ImportError) if issubclass(kind, one)), Exception)
    error = base.__new__(kind, *args)
    error.args = args
    error.__dict__.update(state)
    return error
