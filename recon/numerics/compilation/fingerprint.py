"""What a kernel's compiled code follows from, as one short text."""

import hashlib
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

__all__ = ["fingerprint"]

_PLAIN = (bool, int, float, str, tuple, type(None), np.generic, np.dtype)
"""Constants of a module that end up in compiled code."""


def fingerprint(function: Callable[..., Any]) -> str:
    """Hash the source file of a function, those of the kernels that it calls, and the versions.

    numba looks at the function's own file alone: of a kernel whose callee is in another, it would
    go on taking old code.
    """
    made_of = sorted({f"{kind} {name} {value}"
                      for one in _reached(function, set()) for kind, name, value in _parts(one)})
    text = "\0".join([sys.version, numba.__version__, np.__version__, *made_of])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _reached(function: Callable[..., Any], seen: set[Any]) -> set[Any]:
    """Add a function, and all compiled ones that it calls, to those seen."""
    if function not in seen:
        seen.add(function)
        for value in _globals_of(function).values():
            if isinstance(value, Dispatcher):
                _reached(value.py_func, seen)
    return seen


def _parts(function: Callable[..., Any]) -> Iterator[tuple[str, str, str]]:
    yield "source", function.__module__, _file_hash(function.__code__.co_filename)
    for name, value in _globals_of(function).items():
        if isinstance(value, _PLAIN):
            yield "constant", name, repr(value)
        elif isinstance(value, type) and hasattr(value, "_fields"):
            yield "record", value.__qualname__, repr(value._fields)


def _globals_of(function: Callable[..., Any]) -> dict[str, Any]:
    known = function.__globals__
    return {name: known[name] for name in _names(function.__code__) if name in known}


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


@cache
def _file_hash(name: str) -> str:
    return hashlib.sha256(Path(name).read_bytes()).hexdigest()
