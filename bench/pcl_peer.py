"""PCL's MovingLeastSquares (C++), built here where Debian's libpcl-dev is installed."""

import os
import shutil
import subprocess
import tempfile
import weakref
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.cases import Case

__all__ = ["Pcl", "PclMissingError"]

_SOURCE = Path(__file__).with_name("pcl_mls.cpp")
_LIBRARIES = ("pcl_surface", "pcl_search", "pcl_kdtree", "pcl_octree", "pcl_common")
_ORDER = 2
# In mean spacings: about ten samples around each seed, as dense as ours.
_SPREAD = 0.9
_STEP = 0.5
# A query has a point of PCL's when one is this near, over (X, Y), in mean spacings.
_NEAR = 0.5


class PclMissingError(RuntimeError):
    """PCL's headers or a compiler are not installed."""


class Pcl:
    """The compiled program; it goes, with the folder that holds it, when this does."""

    def __init__(self, *, install: bool) -> None:
        if install and _headers() is None:
            _install()
        headers = _headers()
        if headers is None:
            raise PclMissingError("libpcl-dev is not installed (--pcl installs it)")
        if shutil.which("g++") is None:
            raise PclMissingError("g++ is not installed")
        self._folder = Path(tempfile.mkdtemp(prefix="denseface-pcl-"))
        weakref.finalize(self, shutil.rmtree, self._folder)
        self._program = self._folder / "pcl_mls"
        self.version = headers.name.removeprefix("pcl-")
        built = subprocess.run(
            ["g++", "-std=c++17", "-O3", "-fopenmp", "-w", f"-I{headers}",
             "-I/usr/include/eigen3", str(_SOURCE), "-o", str(self._program),
             *(f"-l{name}" for name in _LIBRARIES)],
            capture_output=True, text=True, check=False)
        if built.returncode:
            raise PclMissingError(f"pcl_mls.cpp does not compile: {built.stderr.strip()[-400:]}")

    def run(self, seeds: NDArray[np.floating], spacing: float, radius: float
            ) -> tuple[NDArray[np.float64], float]:
        """Upsample (n, 3) seeds, mm, with a search radius, mm: ((k, 3) mm, milliseconds)."""
        given, result = (self._folder / name for name in ("seeds", "dense"))
        given.write_bytes(np.ascontiguousarray(seeds, np.float32).tobytes())
        ran = subprocess.run(
            [str(self._program), str(given), str(result), str(radius), str(_ORDER),
             str(_SPREAD * spacing), str(_STEP * spacing)],
            capture_output=True, text=True, check=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"})
        points = np.frombuffer(result.read_bytes(), np.float32).reshape(-1, 3)
        return points[np.isfinite(points).all(axis=1)].astype(np.float64), float(ran.stdout)

    def points(self, case: Case, radius: float) -> tuple[NDArray[np.float64], float]:
        """Give the upsampled point nearest each query, NaN where none is near, and the time."""
        dense, took = self.run(case.seeds, case.spacing, radius)
        distance, nearest = cKDTree(dense[:, :2]).query(case.queries)
        found = dense[nearest]
        found[distance > _NEAR * case.spacing] = np.nan
        return found, took


def _headers() -> Path | None:
    found = sorted(Path("/usr/include").glob("pcl-*"))
    return found[-1] if found and (found[-1] / "pcl/surface/mls.h").is_file() else None


def _install() -> None:
    if shutil.which("apt-get") is None:
        raise PclMissingError("this machine has no apt-get: install PCL's development files")
    root = [] if os.geteuid() == 0 else ["sudo"]
    if root and shutil.which("sudo") is None:
        raise PclMissingError("installing libpcl-dev needs root (no sudo here)")
    done = subprocess.run(
        [*root, "apt-get", "install", "-y", "-qq", "--no-install-recommends", "libpcl-dev"],
        capture_output=True, text=True, check=False,
        env=os.environ | {"DEBIAN_FRONTEND": "noninteractive"})
    if done.returncode:
        raise PclMissingError(f"apt-get install libpcl-dev failed: {done.stderr.strip()[-200:]}")
