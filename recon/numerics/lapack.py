"""A routine of scipy's LAPACK without `scipy.linalg`, which takes fifteen times as long to load."""

from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from typing import Any

import scipy

__all__ = ["dpbsv"]


def _lapack() -> Any:
    """Load the extension module alone; through its package where it is not found."""
    name = "scipy.linalg._flapack"
    spec = PathFinder.find_spec(name, [str(Path(scipy.__file__).parent / "linalg")])
    if spec is None or spec.loader is None:
        from scipy.linalg import lapack

        return lapack
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# Loaded with this module, not when it is first called: `numerics.threads` limits the threads of
# what is loaded before a frame.
dpbsv: Any = _lapack().dpbsv
"""Solve a banded, symmetric, positive definite system in place: as `scipy.linalg.lapack.dpbsv`."""
