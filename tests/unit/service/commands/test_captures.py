"""Commands about captures that the hub keeps, against a made-up hub."""

import cv2
import numpy as np
import pytest

from denseface import load_face
from denseface.capture.npz import load_frame
from denseface.service.cli import main
from denseface.service.protocol import messages
from denseface.service.protocol.wire import Packet
from tests.unit.service.faces import small_frame
from tests.unit.service.fake_hub import fake_hub


@pytest.fixture
def hub(monkeypatch):
    with fake_hub() as hub:
        monkeypatch.setenv("DENSEFACE_ADDRESS", hub.address)
        yield hub


def test_a_kept_face_is_fetched_by_its_id_and_the_last_one_without(hub, tmp_path, capfd):
    hub.conclude("a")
    assert main(["get", "a", "--save", str(tmp_path / "c.npz")]) == 0
    points = len(load_face(tmp_path / "c.npz").dense)
    assert main(["get", "--last", "--report", str(tmp_path / "c.json")]) == 0
    assert (tmp_path / "c.json").read_text().startswith("{")
    assert capfd.readouterr().out == 2 * f"a {points} points\n"


def test_frame_and_photo_are_written_where_there_is_no_face(hub, tmp_path, capfd):
    hub.frames = {"a"}
    frame, photo = tmp_path / "a.npz", tmp_path / "a.png"
    hub.outcomes.append(Packet(messages.CaptureFailed(
        epoch="0f", sequence=1, capture_id="a", error="NoFaceError", message="none", dead=False)))
    both = ["get", "a", "--frame", str(frame), "--photo", str(photo)]
    assert main(both) == 0
    assert main([*both, "--save", str(tmp_path / "a.ply")]) == 1
    written = [f"{frame}: frame of 8x6; `denseface reconstruct {frame}` makes a face of it, "
               "load_frame() reads it",
               f"{photo}: photo of 10x7, {photo.stat().st_size} bytes; any browser or image viewer "
               "opens it"]
    out, said = capfd.readouterr()
    assert out == "a\n"
    assert said.splitlines() == [
        *written, *written, "denseface get: capture a: none (NoFaceError); `denseface get a "
        "--preview P.png` draws what was looked at"]
    np.testing.assert_array_equal(load_frame(frame).depth, small_frame().depth)
    shown = cv2.cvtColor(cv2.imread(str(photo)), cv2.COLOR_BGR2RGB)
    np.testing.assert_array_equal(shown, small_frame().rgb)
    assert {one.stat().st_mode & 0o777 for one in tmp_path.iterdir()} == {0o600}


def test_a_texture_is_of_the_frame_that_the_hub_keeps(hub, tmp_path, capfd):
    hub.frames = {"a"}
    hub.conclude("a")
    given = ["get", "a", "--save", str(tmp_path / "f.glb"), "--textured"]
    assert main(given) == 2, "that of the made-up hub does not show the face"
    assert capfd.readouterr().err.startswith(
        "denseface get: texture: the face is not in this frame's colour image")
    hub.frames = set()
    assert main(given) == 1
    assert not list(tmp_path.iterdir())


def test_a_frame_without_a_face_is_drawn_in_place_of_one(hub, tmp_path, capfd):
    hub.frames = {"a"}
    picture = tmp_path / "why.png"
    hub.outcomes.append(Packet(messages.CaptureFailed(
        epoch="0f", sequence=1, capture_id="a", error="NoFaceError", message="none", dead=False)))
    assert main(["get", "a", "--preview", str(picture)]) == 1
    out, said = capfd.readouterr()
    assert out == ""
    assert said.splitlines()[-2:] == [  # where kernels are compiled first, that is said before
        f"{picture}: picture of the frame, and of what looked like a face",
        "denseface get: capture a: none (NoFaceError)"]
    assert cv2.imread(str(picture)).shape[1] > 1000
    assert picture.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(("arguments", "status", "line"), [
    (["get", "z"], 1, "get: capture z: the hub has no such capture: it was never accepted, or is "
                      "no longer kept"),
    (["get", "../z"], 2, "get: capture id '../z': expected letters, digits, - and _, at most 64"),
    (["get", "a", "--frame", "a.ply"], 2, "get: a.ply: expected a name that ends in .npz"),
    (["get", "z", "--frame", "z.npz"], 1, "get: capture z: the hub has no such capture: it was "
                                          "never accepted, or is no longer kept"),
    (["purge", "--id", "z", "--yes"], 1, "purge: capture z: nothing removed, the hub keeps no such "
                                         "capture"),
])
def test_what_cannot_be_had_is_one_line(hub, capfd, arguments, status, line):
    hub.removals = [(0, False)]
    assert main(arguments) == status
    assert capfd.readouterr() == ("", f"denseface {line}\n")


def test_the_captures_that_are_kept_are_listed_newest_first(hub, capfd):
    assert main(["list", "--last", "2"]) == 0
    assert capfd.readouterr().out == "b then done\na then done\n"


def test_a_purge_by_id_says_what_it_removed(hub, capfd):
    hub.removals = [(1, False)]
    assert main(["purge", "--id", "a", "--yes"]) == 0
    assert capfd.readouterr().out == "1 capture removed\n"
