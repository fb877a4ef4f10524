"""A fresh process is warm before its first frame."""

import importlib
import pkgutil
import subprocess
import sys

import numba

import denseface.recon
from denseface.recon import Settings, reconstruct, warm

MODULES = [importlib.import_module(found.name)
           for found in pkgutil.walk_packages(denseface.recon.__path__, "denseface.recon.")]


def compiled():
    """For which types each kernel stands compiled."""
    return {(module.__name__, name): list(one.signatures)
            for module in MODULES
            for name, one in vars(module).items()
            if isinstance(one, numba.core.registry.CPUDispatcher)}


def test_once_warm_a_frame_compiles_nothing(shot):
    warm()
    before = compiled()
    assert len(before) >= 8
    for preset in ("best", "light"):
        reconstruct(shot.frame, Settings.of(preset))
    assert compiled() == before


def test_loading_kernels_imports_no_more_than_runs():
    warm()  # so that all are kept
    slow = {"scipy.linalg", "scipy.spatial", "numba.np.linalg", "structlog", "open3d", "zmq"}
    code = ("import sys; from denseface.recon import warm; warm()\n"
            f"found = {slow} & set(sys.modules)\nsys.exit(repr(found) if found else 0)")
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
