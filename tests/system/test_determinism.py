"""The same frame gives the same bytes, whatever the number of threads."""

import os
import subprocess
import sys

from tests.system.running import RECORDINGS, REPOSITORY

_HASH = """
import hashlib, sys
from capture import open_source
from recon import reconstruct
with open_source(sys.argv[1]) as source:
    dense = reconstruct(next(iter(source))).dense
for part in (dense.points, dense.colors, dense.normals, dense.sigma, dense.cells):
    print(hashlib.sha256(part.tobytes()).hexdigest())
"""


def test_one_and_two_threads_give_the_same_face():
    said = []
    for threads in ("1", "2"):
        counts = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"),
                               threads)
        said.append(subprocess.run(
            [sys.executable, "-c", _HASH, str(RECORDINGS / "frontal_700.oni")], cwd=REPOSITORY,
            env=os.environ | counts, capture_output=True, text=True, check=True).stdout)
    assert len(said[0].split()) == 5
    assert said[0] == said[1]
