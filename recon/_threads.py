"""One thread for the linear algebra.

The matrices here are thin: more threads only wait for each other, and round otherwise.
"""

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

__all__ = ["one_blas_thread"]

_P = ParamSpec("_P")
_R = TypeVar("_R")


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()


def one_blas_thread(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Make a function run with one BLAS thread, whatever the process is set to."""

    @wraps(function)
    def limited(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
