"""The same frame gives the same bytes, whatever the number of threads."""

import json
import os
import subprocess
import sys
from typing import Any

from tests.system.running import RECORDINGS, REPOSITORY

_HASH = """
import hashlib, json, sys
import cv2, numba
from threadpoolctl import threadpool_info
from denseface.capture import open_source
from denseface.recon import Preset, Settings, reconstruct
# OpenCV goes by no variable that every build of it reads.
cv2.setNumThreads(int(sys.argv[2]))
with open_source(sys.argv[1]) as source:
    frame = next(iter(source))
said = {"hashes": []}
for preset in (Preset.BEST, Preset.FAITHFUL):
    face = reconstruct(frame, Settings.of(preset, neighbors="lattice"))
    clouds = face.initial, face.dense
    arrays = [getattr(cloud, name) for cloud in clouds for name in sorted(vars(cloud))]
    said["hashes"] += [hashlib.sha256(array.tobytes()).hexdigest() for array in arrays
                       if hasattr(array, "tobytes")]
said["opencv"], said["numba"] = cv2.getNumThreads(), numba.get_num_threads()
said["blas"] = sorted({one["num_threads"] for one in threadpool_info()
                       if one["user_api"] == "blas"})
print(json.dumps(said))
"""
_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def said_with(threads: int) -> dict[str, Any]:
    counts = dict.fromkeys(_VARIABLES, str(threads))
    done = subprocess.run(
        [sys.executable, "-c", _HASH, str(RECORDINGS / "frontal_700.oni"), str(threads)],
        cwd=REPOSITORY, env=os.environ | counts, capture_output=True, text=True, check=True)
    loaded: dict[str, Any] = json.loads(done.stdout)
    return loaded


def test_one_two_and_four_threads_give_the_same_face():
    one, two, four = (said_with(threads) for threads in (1, 2, 4))
    assert len(one["hashes"]) >= 12
    assert one["hashes"] == two["hashes"] == four["hashes"]
    # The counts were really those, or nothing is shown.
    assert [said["opencv"] for said in (one, two, four)] == [1, 2, 4]
    assert [said["numba"] for said in (one, two, four)] == [1, 2, 4]
    assert one["blas"] == [1]
    if len(os.sched_getaffinity(0)) > 1:
        assert two["blas"] == [2]
