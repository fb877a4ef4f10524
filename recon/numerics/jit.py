"""Compiling loops; where their code is kept is in `recon.numerics.compilation`."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from denseface.recon.arrays import Floats
from denseface.recon.numerics.compilation.cache import KernelCache
from denseface.recon.numerics.compilation.progress import compiling

__all__ = ["STACK_FLOATS", "compiled", "compiled_exactly", "inlined", "stack_floats"]

STACK_FLOATS = 8
"""Numbers in `stack_floats`."""

_F = TypeVar("_F", bound=Callable[..., Any])


def compiled(function: _F) -> _F:
    """Compile a function of arrays and numbers when it is first called, with fast math."""
    return _kept(function, fastmath=True, error_model="numpy")


def compiled_exactly(function: _F) -> _F:
    """Compile a function as it is written; while it runs, other threads run too."""
    return _kept(function, nogil=True)


def _kept(function: _F, **options: Any) -> _F:
    """Compile a function when it is first called, and keep the code for the next start."""
    kernel: Any = njit(**options)(function)
    if kernel is not function:  # as it is where NUMBA_DISABLE_JIT is set
        kernel._cache = KernelCache(function)
        compiling.add(kernel)
    return cast("_F", kernel)


def inlined(function: _F) -> _F:
    """Compile a function as a part of each that calls it."""
    return cast("_F", njit(fastmath=True, inline="always")(function))


@intrinsic
def _stack_pointer(_: Any) -> tuple[Any, Any]:
    """Allocate `STACK_FLOATS` float32 on the stack."""
    def code(context: Any, builder: Any, _signature: Any, _args: Any) -> Any:
        return cgutils.alloca_once(  # type: ignore[no-untyped-call]
            builder, context.get_value_type(types.float32),
            size=context.get_constant(types.intp, STACK_FLOATS))

    return types.CPointer(types.float32)(), code  # type: ignore[no-untyped-call]


@inlined
def stack_floats() -> Floats:
    """Give (`STACK_FLOATS`,) float32 on the stack, for compiled functions alone.

    The compiler knows that no other array aliases them, and vectorises loops without checks.
    """
    return carray(_stack_pointer(), (STACK_FLOATS,))  # type: ignore[call-arg]
