"""Unit files in a folder: those that are ours and unchanged may be written anew, and removed."""

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Literal

from denseface.service.errors import UsageError
from denseface.service.runtime.files import write_atomically

__all__ = ["check_ours", "remove", "write"]

_SIGNED = """\
# Written by denseface install-units. A change has its place in a drop-in, as made by
# systemctl edit: what is changed here is not overwritten.
# sha256 of what follows: """
_MAX_BYTES = 2**16
"""Of a unit; one of ours is smaller."""


def check_ours(paths: Iterable[Path]) -> None:
    """Raise UsageError where one of these files is not ours, or was changed."""
    for path in paths:
        match _state(path):
            case "changed":
                raise UsageError(f"{path}: changed since it was written; its place is in a "
                                 "drop-in (systemctl edit). --force does it all the same")
            case "foreign":
                raise UsageError(f"{path}: not written by denseface install-units. --force does "
                                 "it all the same")


def write(folder: Path, units: Mapping[str, str]) -> list[Path]:
    """Write units, each whole or not at all; give those that are new or other than before.

    Raises
    ------
    OSError
        As from the system, and it names the file.
    """
    written = []
    for name, text in units.items():
        path, signed = folder / name, _signed(text)
        if _read(path) != signed:
            write_atomically(path, [signed], mode=0o644)
            written.append(path)
    return written


def remove(paths: Iterable[Path]) -> list[Path]:
    """Remove files, and give those that were there; OSError as from the system."""
    removed = []
    for path in paths:
        if path.is_symlink() or path.exists():
            path.unlink()
            removed.append(path)
    return removed


def _signed(text: str) -> bytes:
    return f"{_SIGNED}{hashlib.sha256(text.encode()).hexdigest()}\n{text}".encode()


def _state(path: Path) -> Literal["absent", "ours", "changed", "foreign"]:
    if not path.is_symlink() and not path.exists():
        return "absent"
    found = _read(path)
    if found is None or not found.startswith(_SIGNED.encode()):
        return "foreign"
    digest, _, text = found.removeprefix(_SIGNED.encode()).partition(b"\n")
    return "ours" if hashlib.sha256(text).hexdigest().encode() == digest else "changed"


def _read(path: Path) -> bytes | None:
    """Give what is in a regular file; None where it is none, or too long for a unit."""
    if path.is_symlink() or not path.is_file():
        return None
    with path.open("rb") as file:
        found = file.read(_MAX_BYTES + 1)
    return found if len(found) <= _MAX_BYTES else None
