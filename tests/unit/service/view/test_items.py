"""What words stand for, and what is told of it."""

import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from denseface.capture.npz import save_frame
from denseface.recon import NoFaceError, Settings
from denseface.service.errors import FormatError, UnknownCaptureError, UsageError
from denseface.service.export import save_face
from denseface.service.export.reading import Mesh
from denseface.service.tools.frames import FrameChoice
from denseface.service.view import items as module
from denseface.service.view.captures import Captures
from denseface.service.view.inputs import Reader
from denseface.service.view.items import FaceItem, FrameItem, MeshItem, RecordingItem
from denseface.service.view.messages import Fact
from denseface.service.view.shelf import Shelf, short_names
from denseface.service.view.telling import tell
from tests.face_grid_reader import read_face_grid
from tests.unit.service.faces import small_face, small_frame

FACE, FRAME = small_face(), small_frame()


def reader(first=0, fetch=lambda one: FaceItem(one, FACE, capture=True)):
    return Reader(FrameChoice(10**6), Settings(), first, fetch)


@pytest.fixture
def no_face(monkeypatch):
    def refuse(frame, settings):
        raise NoFaceError("no face found")

    monkeypatch.setattr(module, "reconstruct", refuse)


def test_a_word_is_a_face_a_mesh_frames_or_a_capture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_face(FACE, "face.npz")
    save_face(FACE, "face.PLY")
    (tmp_path / "frames").mkdir()
    for name in ("frames/a.npz", "frames/b.npz", "frame.npz", "3f2a"):
        save_frame(FRAME, name if name.endswith("z") else f"{name}.npz")
    kinds = [(item.head.kind, item.head.name, item.head.frames) for item in reader().items(
        ["face.npz", "face.PLY", "frame.npz", "frames", "3f2a"])]
    mesh = reader().items(["face.PLY"])[0]
    assert [fact.name for fact in tell(mesh, 0, "x").seen.provenance][:1] == ["Made by"]
    assert kinds == [("face", "face.npz", 1), ("mesh", "face.PLY", 1), ("frames", "frame.npz", 1),
                     ("frames", "frames", 2), ("capture", "3f2a", 1)]
    (tmp_path / "3f2a").write_text("")
    with pytest.raises(OSError, match="3f2a: not a known kind"):  # a file goes before a capture
        reader().items(["3f2a"])


@pytest.mark.parametrize(("word", "line"), [
    ("none.npz", "none.npz: no such file"), ("a/b", "a/b: "), ("none.ply", "none.ply: "),
    ("x.calibration.json", "x.calibration.json: ")])
def test_what_is_none_of_them_is_said(word, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((OSError, FormatError, UsageError), match=line):
        reader().items([word])


def test_a_frame_that_is_not_there_is_said_before_anything_is_shown(tmp_path):
    save_frame(FRAME, tmp_path / "frame.npz")
    with pytest.raises(UsageError, match=r"has 1 frames \(0 to 0\), --frame asks for 3"):
        reader(first=3).items([str(tmp_path / "frame.npz")])


def test_a_face_is_told_with_its_figures_and_its_grid():
    told = tell(FaceItem("face.npz", FACE), 0, "face.npz")
    assert (told.seen.shape, told.seen.title, told.picture) == ("face", "face.npz", b"")
    facts = {fact.name: fact.value for fact in told.seen.figures}
    assert facts["Dense points"] == f"{len(FACE.dense)}"
    assert facts["Noise of depth"] == "0.50 mm"
    assert "Exposed after the press" not in facts
    assert json.loads(told.seen.report)["noise_mm"] == 0.5
    assert read_face_grid(told.shape).points.shape == FACE.dense.points.shape
    with pytest.raises(UsageError, match=r"face\.npz: has 1 frame, frame 1 is asked for"):
        tell(FaceItem("face.npz", FACE), 1, "x")


def test_a_face_off_its_grid_is_said_to_be_none():
    face = small_face()
    face.dense.points[3, 0] += 1
    told = tell(FaceItem("face.npz", face), 0, "face.npz")
    assert (told.seen.shape, told.shape) == ("none", b"")
    assert told.seen.problem == "x is not on a grid of 2 mm"


def test_a_mesh_is_told_with_its_size():
    points = np.array([[0, 0, 700], [10, 0, 700], [0, 20, 705]], np.float32)
    mesh = Mesh(points, np.array([[0, 1, 2]], np.int32), None)
    info = {"format": "STL", "closed": False, "provenance": {"sensor": "A"}}
    told = tell(MeshItem("a.stl", mesh, info), 0, "a.stl")
    assert told.seen.provenance == (Fact(name="Sensor", value="A"),)
    assert {fact.name: fact.value for fact in told.seen.figures} == {
        "Format": "STL", "Closed": "no", "Points": "3", "Triangles": "1",
        "Size": "10.0 x 20.0 x 5.0 mm", "Colours": "none"}
    assert told.shape[:4] == b"DFMS"
    empty = tell(MeshItem("a.ply", Mesh(points[:0], None, None)), 0, "a.ply")
    assert (empty.seen.shape, empty.seen.problem) == ("none", "there are no points in it")


def test_a_frame_without_a_face_is_told_with_a_picture(no_face):
    told = tell(FrameItem("d.png", FRAME, Settings()), 0, "d.png")
    assert (told.seen.shape, told.seen.problem) == ("none", "no face found")
    assert told.seen.picture
    assert cv2.imdecode(np.frombuffer(told.picture, np.uint8), cv2.IMREAD_COLOR) is not None


def test_frames_are_gone_through_and_one_that_cannot_be_read_stops_nobody(tmp_path, no_face):
    save_frame(FRAME, tmp_path / "a.npz")
    (tmp_path / "b.npz").write_bytes(b"PK")
    save_frame(FRAME, tmp_path / "c.npz")
    [item] = reader(first=2).items([str(tmp_path)])
    assert isinstance(item, RecordingItem)
    assert (item.head.first, item.head.frames) == (2, 3)
    assert [type(taken.error).__name__ for taken in item.each()] == [
        "NoFaceError", "CaptureError", "NoFaceError"]
    told = tell(item, 1, "folder")
    assert (told.seen.title, told.seen.picture) == ("folder, frame 1", False)
    assert "b.npz" in told.seen.problem
    assert tell(item, 2, "folder").seen.picture


def test_captures_are_fetched_by_one_connection_with_their_frames():
    asked = []
    hub = SimpleNamespace(
        get=lambda one, timeout: asked.append((one, timeout)) or FACE,
        get_frame=lambda _, timeout: FRAME if timeout else None,
        captures=lambda _: [SimpleNamespace(capture_id="newest")])

    class Connection:
        opened = closed = 0

        def __enter__(self):
            Connection.opened += 1
            return hub

        def __exit__(self, *_):
            Connection.closed += 1

    with Captures(Connection, 5.0) as captures:
        assert Connection.opened == 0
        first, last = captures.fetch("3f2a"), captures.last()
        hub.captures = lambda _: []
        with pytest.raises(UnknownCaptureError, match="--last: the hub keeps no capture"):
            captures.last()
    assert (first.name, last.name, first.frame) == ("3f2a", "newest", FRAME)
    assert first.head.kind == "capture"
    assert (Connection.opened, Connection.closed) == (1, 1)
    assert asked == [("3f2a", 5.0), ("newest", 5.0)]


@pytest.mark.parametrize(("names", "short"), [
    (["/a/face.npz"], ["face.npz"]), (["/a/face.npz", "/b/face.npz"], ["a/face.npz", "b/face.npz"]),
    (["x/a/1.ply", "y/a/1.ply", "2.ply"], ["x/a/1.ply", "y/a/1.ply", "2.ply"]),
    (["face.npz", "a/face.npz"], ["face.npz", "a/face.npz"]), (["a", "a"], ["a", "a"]),
    (["/"], ["/"]), ([], [])])
def test_names_are_as_short_as_tells_them_apart(names, short):
    assert short_names(names) == short


async def _told(shelf, *asked):
    return [await shelf.told(*one) for one in asked]


def test_what_was_told_is_kept_as_far_as_there_is_room(monkeypatch):
    import asyncio

    taken = []

    class Counted(FaceItem):
        def take(self, number):
            taken.append(self.name)
            return super().take(number)

    items = [Counted("a", FACE), Counted("b", FACE)]
    asyncio.run(_told(Shelf(items), (0, 0), (1, 0), (0, 0)))
    assert taken == ["a", "b"]
    taken.clear()
    asyncio.run(_told(Shelf(items, max_bytes=1), (0, 0), (0, 0), (1, 0), (0, 0)))
    assert taken == ["a", "b", "a"]
    for item in (-1, 2):
        with pytest.raises(LookupError):
            asyncio.run(_told(Shelf(items), (item, 0)))
