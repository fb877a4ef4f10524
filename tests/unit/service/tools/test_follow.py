"""Outcomes saved as they are published."""

from denseface.service.client import PublishedFace, PublishedFailure, PublishedHint
from denseface.service.errors import CaptureFailedError
from denseface.service.tools.follow import changes, follow
from tests.unit.service.faces import small_face

FACE = small_face()
OUTCOMES = [PublishedFace("e", 1, "a", FACE),
            PublishedFailure("e", 2, "b", CaptureFailedError("b", "NoFaceError", "none"))]


def test_a_face_is_saved_with_its_report_and_a_failure_is_told(tmp_path):
    a, b = follow(OUTCOMES, tmp_path, 0o600)
    assert a == f"1 a {len(FACE.dense)} points"
    assert b.startswith("2 b failed: ")
    assert {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {
        "a.json": 0o600, "a.ply": 0o600}  # whatever the umask


def test_without_a_folder_nothing_is_saved(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(list(follow(OUTCOMES, None, 0o600))) == 2
    assert list(tmp_path.iterdir()) == []


def test_a_hint_is_told_when_it_changes():
    def hint(sensor, *codes, text=""):
        return PublishedHint(sensor, 1, codes, text, {})

    assert list(changes([
        hint("a", "too_far", text="come closer"), hint("a", "too_far", text="come closer"),
        hint("b"), hint("a"), hint("a"), hint("a", "too_far", "dark", text="come closer")])) == [
            "a: come closer (too_far)", "b: good", "a: good", "a: come closer (too_far, dark)"]
