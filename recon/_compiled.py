"""Compiling loops, whichever folders can be written.

Compiled code is cached beside its file or, where that is read-only, in the user's cache folder;
where neither can be written, it is compiled at each start.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

__all__ = ["compiled"]

_F = TypeVar("_F", bound=Callable[..., Any])


def compiled(function: _F) -> _F:
    """Compile a function of arrays and numbers when it is first called, without strict IEEE."""
    try:
        return cast("_F", njit(cache=True, fastmath=True)(function))
    except RuntimeError:  # numba found no folder for its cache
        return cast("_F", njit(fastmath=True)(function))
