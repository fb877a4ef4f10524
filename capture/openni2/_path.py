"""File names that OpenNI2 can open.

It crashes on a name with a byte outside ASCII (a signed index into a hash table) and cuts off names
of 256 bytes and more.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_MAX_BYTES = 255
"""Bytes of a name."""


@contextmanager
def ascii_name(path: Path, *, unique: bool = False) -> Iterator[bytes]:
    """Give a name for a file, which need not exist yet, by which OpenNI2 can open it.

    That is its own name or, where that will not do or must be `unique`, a link to it or its folder
    in a temporary folder, which is removed after the block. An open file stays open.
    """
    name = os.fsencode(path.absolute())
    if _can_open(name) and not unique:
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
        if not _can_open(name):
            raise OSError(f"{path}: OpenNI2 takes only ASCII names of up to {_MAX_BYTES} bytes")
        yield name


def _can_open(name: bytes) -> bool:
    return name.isascii() and len(name) <= _MAX_BYTES
