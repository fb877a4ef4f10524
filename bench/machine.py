"""Where, when and with what a benchmark ran."""

import os
import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import version

__all__ = ["describe"]

_PACKAGES = ("denseface", "numpy", "scipy", "numba", "opencv-python-headless")
_OPEN3D = ("open3d-cpu", "open3d")


def describe(command: str, *more: str) -> str:
    """Give one line for the head of a table: date, machine, versions, how it was called.

    Parameters
    ----------
    command : how to run it again
    more : further versions, as they shall be written
    """
    system = platform.freedesktop_os_release().get("PRETTY_NAME", platform.system())
    found = [f"{name} {version(name)}" for name in _PACKAGES]
    found += [f"{name} {version(name)}" for name in _OPEN3D if _installed(name)]
    load = os.getloadavg()[0]
    return (f"{datetime.now(UTC):%Y-%m-%d}, {os.cpu_count()} cores ({platform.machine()}, load "
            f"{load:.1f} at the start), {system}, Python {sys.version.split()[0]}, "
            f"{', '.join([*found, *more])}; one thread; `{command}`.")


def _installed(name: str) -> bool:
    try:
        version(name)
    except ImportError:
        return False
    return True
