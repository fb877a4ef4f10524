"""structlog without rich: it would load that, where it is installed, for tracebacks of its own.

Those here are plain, and rich with what it brings along is a third of what a process of the service
imports before it has its settings.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["EventDict", "ExcInfo", "Processor", "structlog"]


@contextmanager
def _absent(package: str) -> Iterator[None]:
    """Have imports of a package fail in this block, unless it is there already."""
    absent: Any = None  # as the import system has it: the module is not to be found
    ours = sys.modules.setdefault(package, absent) is None
    try:
        yield
    finally:
        if ours:
            del sys.modules[package]


with _absent("rich"):
    import structlog
    from structlog.typing import EventDict, ExcInfo, Processor
