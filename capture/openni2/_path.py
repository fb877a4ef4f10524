"""File names that OpenNI2 survives.

It crashes on a name with a byte outside ASCII (which indexes a hash table, signed) and cuts off
names of 256 bytes and more.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["plain_name"]

_LONGEST = 255


@contextmanager
def plain_name(path: Path, *, another: bool = False) -> Iterator[bytes]:
    """Give a name for a file, which need not exist yet, by which OpenNI2 can open it.

    Where its own name will not do, or `another` one is wanted, that is a link to its folder or to
    itself in a temporary folder; it is gone after the block. An open file stays open.
    """
    name = os.fsencode(path.absolute())
    if _is_plain(name) and not another:
        yield name
        return
    with tempfile.TemporaryDirectory(prefix="denseface-") as folder:
        if path.exists():
            link = Path(folder) / "recording.oni"
            link.symlink_to(path.absolute())
        else:
            (Path(folder) / "to").symlink_to(path.absolute().parent)
            link = Path(folder) / "to" / path.name
        name = os.fsencode(link)
        if not _is_plain(name):
            raise OSError(f"{path}: OpenNI2 takes only ASCII names of up to {_LONGEST} bytes")
        yield name


def _is_plain(name: bytes) -> bool:
    return name.isascii() and len(name) <= _LONGEST
