import pytest

from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.storage import FolderStore
from tests.unit.service.hub.bench import SETTINGS, Bench


@pytest.fixture
def bench(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        yield Bench(Hub(store, SETTINGS, Settings()), store)
