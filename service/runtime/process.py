"""A process's name, that it leaves no core dumps, and the Python that it runs on."""

import ctypes
import os
import resource
import sys
from collections.abc import Mapping

__all__ = ["CORE_DUMPS_VARIABLE", "TRIED_PYTHONS", "forbid_core_dumps", "name_process",
           "untried_python"]

TRIED_PYTHONS = (3, 11), (3, 14)
"""The first and the last minor version that the tests were run on."""

CORE_DUMPS_VARIABLE = "DENSEFACE_CORE_DUMPS"
"""Environment variable that leaves core dumps as the system has them, where it is 1."""

_PR_SET_DUMPABLE, _PR_SET_NAME = 4, 15
"""See prctl(2)."""
_ZEROS = (ctypes.c_ulong(0),) * 3
"""Of a variadic function: without a type, an argument would be an int."""


def forbid_core_dumps(environment: Mapping[str, str] = os.environ) -> None:
    """Let no core dump of this process be made: there would be frames and faces in it.

    The limit is what files obey, and what children inherit; a pipe, as systemd's, goes by the
    flag alone. Without that flag no other process of this user may look into the memory either.
    """
    if environment.get(CORE_DUMPS_VARIABLE) == "1":
        return
    # The hard limit stays: a program that calls the command's `main` may raise it again.
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    _prctl(_PR_SET_DUMPABLE, 0)


def name_process(name: bytes) -> None:
    """Set what `ps` and `top` show, at most 15 bytes."""
    _prctl(_PR_SET_NAME, name)


def untried_python(version: tuple[int, int, int] = sys.version_info[:3]) -> str:
    """Say so where this Python is newer than any that was tried; empty where it is not."""
    (major, first), (_, last) = TRIED_PYTHONS
    if version[:2] <= (major, last):
        return ""
    return (f"Python {'.'.join(map(str, version))} is newer than any that denseface was tried "
            f"on ({major}.{first} to {major}.{last})")


def _prctl(option: int, value: int | bytes) -> None:
    """Call prctl(2), where there is one."""
    if prctl := getattr(ctypes.CDLL(None), "prctl", None):
        prctl(option, value if isinstance(value, bytes) else ctypes.c_ulong(value), *_ZEROS)
