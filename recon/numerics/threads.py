"""One thread for the linear algebra.

The matrices here are thin: more threads only wait for each other, and sum in another order.
"""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

__all__ = ["one_blas_thread"]

_P = ParamSpec("_P")
_R = TypeVar("_R")


@cache
def _blas() -> Any:
    return ThreadpoolController().select(user_api="blas")


def one_blas_thread(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Make a function run with one BLAS thread, whatever the process is set to."""

    @wraps(function)
    def limited(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        if all(library.num_threads == 1 for library in _blas().lib_controllers):
            return function(*args, **kwargs)
        with _blas().limit(limits=1):
            return function(*args, **kwargs)

    return limited
