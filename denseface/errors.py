"""The base of every error of this product; all that a caller may catch are in `denseface` itself.

=========================== =======================================================================
`CaptureError`              between a sensor or file and a frame
`ReconstructionError`       a frame that does not become a face: the same for the same frame
`ServiceError`              between a press and a published face, and files of faces
=========================== =======================================================================

Each is also the builtin kind that a caller would expect to catch: `CalibrationError` is a
`ValueError`, `ClientTimeoutError` a `TimeoutError`. An argument of a wrong type is a plain
`TypeError`, and what the system refuses where a file is written an `OSError`.
"""

__all__ = ["DensefaceError"]


class DensefaceError(Exception):
    """Base of every error raised by denseface."""
