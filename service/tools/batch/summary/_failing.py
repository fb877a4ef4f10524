"""What can go wrong with a file of the summary, in one line that names it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa

from denseface.service.errors import (
    CorruptFileError,
    DiskFullError,
    StoreError,
    is_full,
    reason_of,
)

__all__ = ["corrupt", "named"]


@contextmanager
def named(path: Path) -> Iterator[None]:
    """Raise what fails within as StoreError that names a file; CorruptFileError of its contents."""
    try:
        yield
    except StoreError:
        raise
    # pyarrow says damage as ArrowInvalid or as an OSError without a number.
    except (pa.ArrowException, OSError) as error:
        number = getattr(error, "errno", None)
        if number is None:
            raise corrupt(path, str(error)) from error
        kind = DiskFullError if is_full(number) else StoreError
        raise kind(f"{path}: {reason_of(error)}") from error


def corrupt(path: Path, why: str) -> CorruptFileError:
    """Give the error of a file that has other contents than it should."""
    line = why.strip().partition("\n")[0][:200].rstrip(".")
    return CorruptFileError(
        f"{path}: is no summary of `denseface batch`, or damaged ({line}): move it away, and a run "
        "into this folder makes it anew")
