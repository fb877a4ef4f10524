"""Memory of a process, and what one call needs beyond what the process holds."""

import ctypes
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Extra", "extra_memory", "proportional_mb", "resident_mb"]

_STATUS = Path("/proc/self/status")
_CLEAR_REFS = Path("/proc/self/clear_refs")
_RESET_PEAK = "5"
"""proc(5): sets the peak of the resident set (VmHWM) to its present size."""
_MB = 1024


@dataclass(frozen=True)
class Extra:
    """The peak above the start, MiB."""

    arrays: float
    """What Python and NumPy allocated, by tracemalloc; C++ libraries are not in it."""
    resident: float
    """The resident set, by the kernel: all libraries included."""


def extra_memory(call: Callable[[], object]) -> Extra:
    """Measure a call, once for each figure (tracing slows it down)."""
    # Pages that earlier calls freed but the C library keeps would hide what this one needs.
    ctypes.CDLL(None).malloc_trim(0)
    before = _kilobytes("VmRSS")
    _CLEAR_REFS.write_text(_RESET_PEAK)
    call()
    resident = (_kilobytes("VmHWM") - before) / _MB
    tracemalloc.start()
    try:
        held = tracemalloc.get_traced_memory()[0]
        call()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    return Extra(arrays=(peak - held) / _MB**2, resident=resident)


def resident_mb() -> float:
    """Give the resident set of this process, MiB."""
    return _kilobytes("VmRSS") / _MB


def proportional_mb(pid: int) -> tuple[float, float]:
    """Give what a process has with its share of what others have too, and what it alone has, MiB.

    PSS and USS: the kernel counts both (proc(5), smaps_rollup).
    """
    rollup = Path(f"/proc/{pid}/smaps_rollup")
    pss, *private = (_kilobytes(field, rollup) / _MB
                     for field in ("Pss", "Private_Clean", "Private_Dirty"))
    return pss, sum(private)


def _kilobytes(field: str, file: Path = _STATUS) -> int:
    for line in file.read_text().splitlines():
        if line.startswith(f"{field}:"):
            return int(line.split()[1])
    raise RuntimeError(f"{file} has no {field}")
