"""A kept kernel made ready to run, and no more than that.

numba first tells the compiler of all that can be compiled, imports its own functions' modules, one
of them with `scipy.linalg`, and reads the LLVM code that another kernel would take in: that takes
longer than the rest, and serves only a process that compiles, which does it then.
"""

import pickle
import sys
from functools import cache, partial
from pathlib import Path
from typing import Any

from numba.core import codegen, compiler, environment
from numba.core.runtime import nrt

__all__ = ["read", "rebuild"]

# numba has no types.
_codegen: Any = codegen
_environments: Any = environment
_runtime: Any = nrt.rtsys
_rebuild: Any = compiler.CompileResult._rebuild


def read(path: Path) -> Any:
    """Read what `CompileResult._reduce` made of a kernel; from a file that is trusted."""
    with path.open("rb") as file:
        return _Unpickler(file).load()


def rebuild(target_context: Any, library: Any, description: Any, *more: Any) -> Any:
    """Give a kernel that can be called, and compiled into others.

    Parameters
    ----------
    library, description, more : what `read` gives
    """
    _runtime.initialize(target_context)
    name, kind, (machine_code, bitcode) = library
    engine = target_context.codegen()._engine
    engine._defined_symbols |= {  # as numba finds them in the LLVM code
        description.llvm_func_name, description.llvm_cpython_wrapper_name,
        description.llvm_cfunc_wrapper_name}
    code = _rebuild(target_context, (name, kind, (machine_code, _nothing())), description, *more)
    code.library._shared_module = None
    code.library._get_module_for_linking = partial(_for_linking, code.library, engine, bitcode)
    return code


def _for_linking(library: Any, engine: Any, bitcode: bytes) -> Any:
    if library._shared_module is None:
        module = _codegen.ll.parse_bitcode(bitcode)
        engine._load_defined_symbols(module)
        library._shared_module = module
    return library._shared_module


@cache
def _nothing() -> Any:
    """Give an empty module's LLVM code."""
    return _codegen.ll.parse_assembly("").as_bitcode()


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("numba.core.environment", "_rebuild_env"):
            return _environment
        return super().find_class(module, name)


def _environment(module: str, constants: list[Any], name: str) -> Any:
    """Give the environment of a function that a kernel took in, without importing its module.

    Compiled code takes the constants from it; the globals are for object mode.
    """
    found = _environments.lookup_environment(name)
    if found is None:
        known = sys.modules.get(module)
        found = _environments.Environment(vars(known) if known else {"__name__": module})
        found.consts[:] = constants
        found.env_name = name
        found._memo[name] = found
    return found
