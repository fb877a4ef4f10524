"""A face that turns: its loop, the light, and what others read of its files."""

import io
from dataclasses import replace
from xml.parsers.expat import ParserCreate

import cv2
import numpy as np
import pytest
from PIL import Image

from denseface.service.errors import FormatError
from denseface.service.export._drawing import BACKGROUND
from denseface.service.export.provenance import provenance
from denseface.service.export.turning import animation, views
from tests.unit.service.faces import small_face

FRAMES, WIDTH, HEIGHT = 16, 96, 120
FACE = small_face(60, 44, 2.0)
FACE = replace(FACE, report=FACE.report.model_copy(update={"source": 'a "take"&.oni#3'}))


@pytest.fixture(autouse=True)
def _whole_loop(_short_loops, monkeypatch):
    monkeypatch.setattr(views, "_FRAMES", FRAMES)


def covered(frame: np.ndarray) -> np.ndarray:
    return (np.abs(frame.astype(int) - BACKGROUND) > 12).any(axis=2)


def test_the_loop_has_no_jump_and_the_face_stays_in_the_picture():
    frames = list(views.turned(FACE.dense))
    assert [one.shape for one in frames] == [(HEIGHT, WIDTH, 3)] * FRAMES
    steps = [float(np.abs(one.astype(int) - other).mean()) for one, other in zip(
        frames, [*frames[1:], frames[0]], strict=True)]
    assert steps[-1] == pytest.approx(steps[0], rel=0.3)
    assert max(steps) == pytest.approx(steps[0], rel=0.5)
    for frame in frames:
        rows, columns = covered(frame).any(axis=1), covered(frame).any(axis=0)
        assert not np.concatenate([rows[[0, -1]], columns[[0, -1]]]).any()
        middle = np.flatnonzero(columns)
        assert abs((middle[0] + middle[-1]) / 2 - WIDTH / 2) < 0.1 * WIDTH
    assert np.flatnonzero(covered(frames[0]).any(axis=1)).size > 0.7 * HEIGHT


def test_there_is_no_gap_within_the_face_at_any_angle():
    for frame in views.turned(FACE.dense):
        mask = covered(frame).astype(np.uint8)
        outside = np.pad(mask, 1)
        cv2.floodFill(outside, None, (0, 0), 2)
        assert not (outside == 0).any()


def test_it_turns_to_both_sides_and_the_light_stands_still():
    frames = list(views.turned(FACE.dense))
    right, left = frames[FRAMES // 4], frames[3 * FRAMES // 4]
    assert np.abs(right.astype(int) - left).mean() > 5
    plain = replace(FACE.dense, colors=np.full_like(FACE.dense.colors, 128))
    shown = list(views.turned(plain))
    lit = [float(one[covered(one)].mean()) for one in shown]
    assert max(lit) - min(lit) > 3, "it is lit alike from all sides"


def test_webp_is_a_loop_that_says_where_the_face_comes_from():
    picture = Image.open(io.BytesIO(animation.to_webp(FACE)))
    assert (picture.n_frames, picture.size, picture.info["loop"]) == (FRAMES, (WIDTH, HEIGHT), 0)
    for number, expected in enumerate(views.turned(FACE.dense)):
        picture.seek(number)
        assert np.abs(np.asarray(picture.convert("RGB")).astype(int) - expected).mean() < 4
    assert told(picture.info["xmp"]) == provenance(FACE.report)


def told(packet: bytes) -> dict[str, str]:
    found = {}
    parser = ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = lambda _, given: found.update(given)
    parser.Parse(packet, True)
    return {name.partition(" ")[2]: text for name, text in found.items() if "denseface" in name}


@pytest.mark.parametrize("codec", ["vp09", "mp4v"])
def test_mp4_is_a_video_where_there_is_an_encoder(monkeypatch, tmp_path, capfd, codec):
    monkeypatch.setattr(animation, "_CODECS", ("avc1", codec))
    try:
        data = animation.to_mp4(FACE)
    except FormatError as error:
        pytest.skip(str(error))
    assert not any(capfd.readouterr())
    path = tmp_path / "face.mp4"
    path.write_bytes(data)
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == FRAMES
    read, frame = video.read()
    assert read
    first = next(views.turned(FACE.dense))
    assert np.abs(frame[:, :, ::-1].astype(int) - first).mean() < 8
    assert told(data[data.index(b"<?xpacket"):]) == provenance(FACE.report)


def test_a_machine_without_an_encoder_is_told_of_the_other_format(monkeypatch, capfd):
    monkeypatch.setattr(animation, "_CODECS", ())
    with pytest.raises(FormatError, match=r"no encoder for video .*; \.webp holds the same"):
        animation.to_mp4(FACE)
    assert not any(capfd.readouterr())


def test_a_video_that_the_disk_does_not_take_is_said(monkeypatch):
    monkeypatch.setattr(animation, "_encode", lambda _, path: path.write_bytes(b"ftyp mdat"))
    with pytest.raises(OSError, match="The video could not be written whole"):
        animation.to_mp4(FACE)
