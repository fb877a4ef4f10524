"""A data folder with a capture in each state that stays."""

import pytest

from denseface.recon.settings import Settings
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore
from tests.unit.service.clocks import FakeClock
from tests.unit.service.storage.test_folder_store import frame, result
from tests.unit.service.storing import accept, finish


@pytest.fixture
def data(tmp_path):
    """A folder with a face, a failure, a dead letter and a frame that waits."""
    with FolderStore(tmp_path / "data", FakeClock()) as store:
        for name in ("done", "failed", "dead", "waits"):
            accept(store, frame(name), Settings(), "0f")
        finish(store, result("done", store))
        store.fail("failed", CaptureState.FAILED, "NoFaceError", "no face")
        store.fail("dead", CaptureState.DEAD, "WorkerLost", "gone")
    return tmp_path / "data"
