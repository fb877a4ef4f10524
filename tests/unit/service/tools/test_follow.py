"""Outcomes saved as they are published."""

import pytest

from denseface.service.client import PublishedFace, PublishedFailure, PublishedHint
from denseface.service.errors import CaptureFailedError, StoreError, UsageError
from denseface.service.export import load_face
from denseface.service.storage import FolderStore
from denseface.service.tools.follow import FaceFolder, changes, follow
from tests.unit.service.faces import small_face

FACE = small_face()
OUTCOMES = [PublishedFace("e", 1, "a", FACE),
            PublishedFailure("e", 2, "b", CaptureFailedError("b", "NoFaceError", "none"))]


def test_a_face_is_saved_with_its_report_and_a_failure_is_told(tmp_path):
    folder = tmp_path / "new" / "faces"
    a, b = follow(OUTCOMES, FaceFolder(folder, [".ply", ".glb", ".npz"], 0o600))
    assert a == (f"1 a {len(FACE.dense)} points", False)
    assert b.line.startswith("2 b failed: ")
    assert {path.name: path.stat().st_mode & 0o777 for path in folder.iterdir()} == {
        "a.json": 0o600, "a.ply": 0o600, "a.glb": 0o600, "a.npz": 0o600}  # whatever the umask
    assert {path.stat().st_mode & 0o777 for path in (folder, folder.parent)} == {0o700}
    assert load_face(folder / "a.npz").report == FACE.report


def test_a_face_that_cannot_be_saved_is_told_and_the_next_is_saved(tmp_path):
    folder = FaceFolder(tmp_path, [".ply"], 0o600)
    (tmp_path / "a.ply").mkdir()
    another = PublishedFace("e", 3, "c", FACE)
    a, b, c = follow([*OUTCOMES, another], folder)
    assert a.lost
    assert a.line.startswith(f"1 a not saved: {tmp_path / 'a.ply'}: is a folder, expected a file; ")
    assert "denseface get a --save FILE" in a.line
    assert [b.lost, c.lost] == [False, False]
    assert {path.name for path in tmp_path.iterdir()} == {"a.ply", "c.ply", "c.json"}


def test_a_folder_that_cannot_be_had_is_known_at_the_start(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match=r"file/faces: .*file is no folder$"):
        FaceFolder(tmp_path / "file" / "faces", [".ply"], 0o600)
    FolderStore(tmp_path / "data").close()
    for name in ("data", "data/faces", "data/new"):
        with pytest.raises(UsageError, match="is a hub's data folder"):
            FaceFolder(tmp_path / name, [".ply"], 0o600)
    assert not (tmp_path / "data" / "new").exists()


def test_without_a_folder_nothing_is_saved(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(list(follow(OUTCOMES, None))) == 2
    assert list(tmp_path.iterdir()) == []


def test_a_hint_is_told_when_it_changes():
    def hint(sensor, *codes, text=""):
        return PublishedHint(sensor, 1, codes, text, {})

    assert list(changes([
        hint("a", "too_far", text="come closer"), hint("a", "too_far", text="come closer"),
        hint("b"), hint("a"), hint("a"), hint("a", "too_far", "dark", text="come closer")])) == [
            "a: come closer (too_far)", "b: good", "a: good", "a: come closer (too_far, dark)"]
