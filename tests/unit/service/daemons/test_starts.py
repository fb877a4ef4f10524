"""What a process of the service does not load when it starts: each is started again and again."""

import subprocess
import sys

import pytest

DRAWS_PAGES = {"starlette", "uvicorn"}
COMPUTES = {"numba", "scipy", "denseface.recon.pipeline"}
UNWANTED = {"rich", "open3d", "matplotlib", "prometheus_client"}
LOADS = {
    "denseface.service.daemons.supervisor": {
        "numpy", "zmq", "sqlite3", "denseface.service.protocol.messages", "cv2",
        *DRAWS_PAGES, *COMPUTES},
    "denseface.service.kiosk.settings": {
        "numpy", "zmq", "denseface.service.protocol.messages", *DRAWS_PAGES, *COMPUTES},
    "denseface.service.daemons.hub": {"cv2", *DRAWS_PAGES, *COMPUTES},
    "denseface.service.daemons.capture": {"sqlite3", "primesense", *DRAWS_PAGES, *COMPUTES},
    "denseface.service.daemons.worker": {"sqlite3", *DRAWS_PAGES},
    "denseface.service.kiosk.process": {"sqlite3", "psutil", "segno", *COMPUTES},
}
"""Module -> what it is to do without until somebody asks for that."""


@pytest.mark.parametrize("module", LOADS)
def test_a_process_loads_nothing_that_its_start_does_not_need(module):
    code = (f"import sys, denseface.service.daemons.startup, {module}\n"
            f"found = {LOADS[module] | UNWANTED} & set(sys.modules)\n"
            "sys.exit(repr(found) if found else 0)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
