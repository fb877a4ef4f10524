"""The folder that benchmarks fill is one that a hub could have left."""

import sqlite3
from contextlib import closing

from bench.growth_captures import fill
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore, Progress


def test_a_filled_folder_opens_as_it_is_and_can_be_made_again(tmp_path):
    ids = fill(tmp_path / "data", 21)
    progress = Progress()
    with FolderStore(tmp_path / "data", progress=progress) as store:
        assert progress.files == 0
        assert store.counts() == {
            CaptureState.DONE: 17, CaptureState.FAILED: 2, CaptureState.DEAD: 2}
        for capture_id in ids:
            assert store.frame(capture_id).message.capture_id == capture_id
            assert store.outcome(capture_id).message.capture_id == capture_id
    with closing(sqlite3.connect(tmp_path / "data" / "captures.sqlite3")) as database, database:
        database.execute("DELETE FROM outcomes")
        database.execute("DELETE FROM captures")
    with FolderStore(tmp_path / "data") as store:
        assert store.counts() == {CaptureState.DONE: 17, CaptureState.ACCEPTED: 4}
