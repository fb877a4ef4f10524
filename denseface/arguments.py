"""What a call was given in place of what it takes: one line that names both."""

import os
from pathlib import Path

__all__ = ["as_path", "describe", "expect"]

_MAX_TEXT = 40
"""Characters of a text that was given."""


def expect(name: str, given: object, kind: type, hint: str = "") -> None:
    """Raise TypeError unless an argument is of its kind; `hint` says how to get one."""
    if not isinstance(given, kind):
        raise TypeError(f"{name}: expected {kind.__name__}, found {describe(given)}"
                        + (f": {hint}" if hint else ""))


def as_path(given: object, name: str = "path") -> Path:
    """Give a path that was given as text or as a path; TypeError for anything else."""
    path = os.fspath(given) if isinstance(given, str | os.PathLike) else None
    if not isinstance(path, str):
        raise TypeError(f"{name}: expected str or Path, found {describe(given)}")
    return Path(path)


def describe(given: object) -> str:
    """Say what an argument is, in a few words."""
    if given is None:
        return "None"
    if isinstance(given, type):
        return f"the class {given.__name__}"
    if isinstance(given, str | bytes):
        return f"{type(given).__name__} {given[:_MAX_TEXT]!r}"
    name = type(given).__name__
    dtype, shape = getattr(given, "dtype", None), getattr(given, "shape", None)
    if dtype is not None and shape is not None:
        return f"{name} of {dtype} {tuple(shape)}"
    if isinstance(given, bool | int | float):
        return f"{name} {given}"
    return name
