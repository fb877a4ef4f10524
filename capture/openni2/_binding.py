"""The binding of OpenNI2, so that it can be imported on every Python that denseface runs on.

`primesense` is of 2013. The metaclass of its enums makes their members within `__new__`; since
Python 3.13, ctypes readies a class in `__init__` alone, and until then calling it raises "abstract
class". Here the members are made when the class is ready. All others import the binding from here.
Only it and the standard library are imported, so that any Python can try it.
"""

import ctypes
import platform
from typing import Any

__all__ = ["OpenNIError", "c_api", "openni2"]

_Ctypes: Any = type(ctypes.c_int)
"""The metaclass that the binding's own is derived from."""


def _init(enum: Any, name: str, bases: Any, namespace: dict[str, Any]) -> None:
    """Ready a class derived from `CEnum`, then make its members, as the binding's `__new__` does.

    The numbers are the namespace's: those of `_names_` may be text, as C has them.
    """
    _Ctypes.__init__(enum, name, bases, namespace)
    if namespace.get("__module__") == utils.__name__:
        return  # the bases of the enums have no members
    names, values = namespace["_names_"], namespace["_values_"]
    values.clear()
    for member in names:
        if not member.startswith("_"):
            number = names[member] = namespace[member]
            values[number] = member
            setattr(enum, member, enum(number))


try:
    from primesense import utils

    if "__new__" in vars(utils.CEnumMeta):
        del utils.CEnumMeta.__new__
        utils.CEnumMeta.__init__ = _init
    # The enums are made now.
    from primesense import _openni2 as c_api
    from primesense import openni2

    OpenNIError = utils.OpenNIError
except Exception as error:  # whatever a Python that came later makes of it
    raise ImportError(
        "the binding of OpenNI2, primesense, cannot be imported by Python "
        f"{platform.python_version()}: {error}",
        name=error.name if isinstance(error, ModuleNotFoundError) else None) from error
