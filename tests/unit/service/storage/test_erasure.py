"""How much is asked of the disk to erase many captures."""

import json
import os
import threading
from collections import Counter
from pathlib import Path

import pytest

from denseface.recon.settings import Settings
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore
from denseface.service.storage._database import Database
from tests.unit.service.storage.test_folder_store import frame, result
from tests.unit.service.storing import accept, finish

NAMES = [f"c{number}" for number in range(40)]


@pytest.fixture
def store(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        for name in NAMES:
            accept(store, frame(name), Settings(), "0f")
            finish(store, result(name, store))
        yield store


@pytest.fixture
def calls(monkeypatch):
    """Counts calls of the system, transactions and reports that are read."""
    counts, lock = Counter(), threading.Lock()

    def counted(name, call):
        def count(*arguments, **more):
            with lock:
                counts[name] += 1
            return call(*arguments, **more)
        return count

    for name, owner, attribute in (
            ("unlink", Path, "unlink"), ("sync", os, "fsync"),
            ("transaction", Database, "transaction"), ("emptied", Database, "truncate_log"),
            ("read", json, "loads")):
        monkeypatch.setattr(owner, attribute, counted(name, getattr(owner, attribute)))
    return counts


def test_a_batch_has_three_transactions_one_sync_of_each_folder_and_one_emptied_log(store, calls):
    store.retention.remove(NAMES, CaptureState.REMOVED)
    assert calls == {"transaction": 1}
    calls.clear()
    store.retention.erase(NAMES)
    # Frame and face, each with or without its name.
    assert calls == {"unlink": 4 * len(NAMES), "sync": 2, "transaction": 2, "emptied": 1}
    assert not list(store._layout.frames.iterdir())
    assert not list(store._layout.faces.iterdir())


def test_a_report_in_quarantine_is_read_once_however_many_batches_there_are(store, calls):
    for name in NAMES[:9]:
        store._quarantine.add(store._layout.frame(name), "damaged", name)
    calls.clear()
    for batch in (NAMES[9:20], NAMES[20:], NAMES[:9]):
        store.retention.remove(batch, CaptureState.REMOVED)
        store.retention.erase(batch)
    assert calls["read"] == 9
    assert not list(store._layout.quarantine.iterdir())


def test_the_loop_syncs_nothing_and_no_file_goes_before_the_thread_has(store, monkeypatch):
    steps = []
    transaction, unlink = Database.transaction, Path.unlink

    def begun(database, *, synced=True):
        steps.append("synced" if synced else "not synced")
        return transaction(database, synced=synced)

    def unlinked(path, **more):
        steps.append("unlink")
        unlink(path, **more)

    monkeypatch.setattr(Database, "transaction", begun)
    monkeypatch.setattr(Path, "unlink", unlinked)
    store.retention.remove(NAMES[:1], CaptureState.REMOVED)
    assert steps == ["not synced"]
    store.retention.erase(NAMES[:1])
    assert steps[1] == "synced"
    assert set(steps[2:-1]) == {"unlink"}
    assert steps[-1] == "synced"
