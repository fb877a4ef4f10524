"""Compile all kernels now, so that no start has to."""

import os
from typing import NamedTuple

from denseface.recon import measurement
from denseface.recon.numerics.compilation.progress import compiling, nowhere
from denseface.service.daemons import worker

__all__ = ["Kept", "warm_up"]


class Kept(NamedTuple):
    """What there is now."""

    found: str
    """How much was compiled, and where it is."""
    lost: str
    """Why the next start compiles all the same; empty where it need not."""


def warm_up() -> Kept:
    """Compile what is not compiled yet."""
    with compiling.session():
        worker.warm()
        measurement.warm()
    found = f"{len(compiling)} kernels are ready, "
    found += "compiled now" if compiling.compiled else "as they were before"
    if compiling.folders:
        found += f", below {os.path.commonpath(compiling.folders)}"
    return Kept(found, nowhere(compiling.lost) if compiling.lost else "")
