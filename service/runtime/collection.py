"""Python's search for garbage, put off while a process starts.

Imports and kernels make hundreds of thousands of objects that stay, and each search looks through
all there are: an eighth of the processor time of a short command.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["collect_from_now_on", "collection_put_off"]


@contextmanager
def collection_put_off() -> Iterator[None]:
    """Collect no garbage in this block, unless `collect_from_now_on` is called in it."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()


def collect_from_now_on() -> None:
    """Say that the process has started, and goes on for as long as one likes."""
    gc.enable()
