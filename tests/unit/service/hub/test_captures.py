"""Where each capture stands."""

import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import StoreError
from denseface.service.hub.captures import Captures
from denseface.service.protocol.states import CaptureEvent, CaptureState, TransitionError
from denseface.service.storage import FolderStore
from tests.unit.service.storage.test_folder_store import frame
from tests.unit.service.storing import accept


@pytest.fixture
def store(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        yield store


def test_what_a_restart_forgets_is_in_memory(store):
    accept(store, frame("a"), Settings(), "0f")
    captures = Captures(store)
    captures.advance("a", CaptureEvent.DISPATCHED)
    captures.advance("b", CaptureEvent.PRESSED)
    assert (captures.state("a"), captures.state("b")) == (
        CaptureState.WORKING, CaptureState.PRESSED)
    assert store.find("a").state is CaptureState.ACCEPTED
    again = Captures(store)
    assert (again.state("a"), again.state("b")) == (CaptureState.ACCEPTED, None)


def test_what_the_store_refuses_changes_no_state(store):
    accept(store, frame("a"), Settings(), "0f")
    captures = Captures(store)
    captures.advance("a", CaptureEvent.DISPATCHED)

    def refuses():
        with captures.transition(CaptureEvent.REJECTED, "a") as state:
            assert state is CaptureState.FAILED
            raise StoreError("the disk fails")

    with pytest.raises(StoreError):
        refuses()
    assert captures.state("a") is CaptureState.WORKING


def test_an_event_that_cannot_happen_is_a_fault(store):
    captures = Captures(store)
    assert not captures.allows("a", CaptureEvent.DISPATCHED)
    with pytest.raises(TransitionError, match="unknown cannot be dispatched"):
        captures.advance("a", CaptureEvent.DISPATCHED)
    with pytest.raises(TransitionError), captures.transition(CaptureEvent.PURGED, "a"):
        pytest.fail("nothing is written")
