import errno
import os
import struct
from dataclasses import replace

import numpy as np
import pytest

from denseface.capture.calibration import Calibration, ChosenCalibration
from denseface.capture.errors import FrameError, UnreadableSourceError
from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin, RgbdFrame
from denseface.capture.oni import records
from denseface.capture.oni.file import read_oni
from denseface.capture.oni.mend import what_is_missing
from denseface.capture.oni.recorded import Recorded
from denseface.capture.oni.records import DEPTH_NODE, IMAGE_NODE
from denseface.capture.oni.writer import OniWriter
from tests.unit import frames

DEPTH_US, COLOR_US = 1_000_000, 1_012_000
PERIOD_US = 33_333


def frame(number: int = 0, **changes) -> RgbdFrame:
    made = frames.frame(
        np.full((120, 160), 700 + number, np.uint16), np.full((120, 160, 3), 90, np.uint8),
        depth_meaning=DepthMeaning(1000, DepthRounding.CUT),
        origin=FrameOrigin("A00365", "2026-11-29T12:00:00.000+00:00"))
    return replace(made, depth_timestamp_us=DEPTH_US + number * PERIOD_US,
                   color_timestamp_us=COLOR_US + number * PERIOD_US, **changes)


def without_color() -> RgbdFrame:
    return replace(frame(), color=None, color_timestamp_us=DEPTH_US)


@pytest.fixture
def writer(tmp_path):
    writer = OniWriter(tmp_path / "take.oni")
    yield writer
    writer.close()


def test_what_is_written_is_found(writer):
    for number in range(3):
        writer.add(frame(number))
    writer.close()
    writer.close()
    found = read_oni(writer.path)
    assert (found.cut, found.max_node, found.end) == (None, 2, writer.path.stat().st_size)
    assert what_is_missing(found) is None
    depth, color = (found.node(kind) for kind in (DEPTH_NODE, IMAGE_NODE))
    assert (depth.frames, depth.sides, depth.registered) == (3, (160, 120), False)
    assert (color.frames, color.sides) == (3, (160, 120))
    assert list(found.stamps_us) == [first + i * PERIOD_US for i in range(3)
                                     for first in (DEPTH_US, COLOR_US)]


def test_the_tables_lead_to_the_frames(writer):
    """For other programs, which seek."""
    for number in range(3):
        writer.add(frame(number))
    writer.close()
    content = writer.path.read_bytes()
    for node in read_oni(writer.path).nodes.values():
        at = node.seek_table_at
        _, kind, number, fields, size, _ = records.HEAD.unpack_from(content, at)
        assert (kind, size) == (records.Kind.SEEK_TABLE, 4 * records.SEEK_ENTRY.size)
        table = list(records.SEEK_ENTRY.iter_unpack(content[at + fields:at + fields + size]))
        assert table[0] == (0, 0, 0)
        for index, (stamp_us, _, position) in enumerate(table[1:], 1):
            head = records.HEAD.unpack_from(content, position)
            assert head[1:3] == (records.Kind.NEW_DATA, number)
            assert records.FRAME.unpack_from(content, position + records.HEAD.size) == (
                stamp_us, index)


def test_each_frame_is_in_the_file_at_once(writer):
    for number in range(3):
        writer.add(frame(number))
        found = read_oni(writer.path)
        assert "without an end record" in found.cut
        assert found.node(DEPTH_NODE).frames == found.node(IMAGE_NODE).frames == number + 1
        assert what_is_missing(found) is None


def test_what_the_frames_mean_is_kept(writer):
    for number in range(2):
        writer.add(frame(number, registered=True))
    writer.close()
    recorded = Recorded(writer.path)
    assert recorded.depth.registered
    assert recorded.pairs == 2
    assert recorded.calibration == ChosenCalibration(
        frames.calibration(), "recording: unspecified")
    assert recorded.meaning(DepthMeaning()) == DepthMeaning(1000, DepthRounding.CUT)
    assert recorded.shift_us == {DEPTH_NODE: 0, IMAGE_NODE: 0}
    assert recorded.origin(DEPTH_US + PERIOD_US, 1) == FrameOrigin(
        "A00365", "2026-11-29T12:00:00.033+00:00", skew_known_by="stamps",
        source=f"{writer.path.name}#1")


@pytest.mark.parametrize("skew_us", [25_000, -40_000, 900_000])
def test_pairs_that_are_far_apart_stay_pairs(writer, skew_us):
    """As of a sensor whose streams are slow, or have clocks of their own."""
    for number in range(4):
        one = frame(number)
        writer.add(replace(one, color_timestamp_us=one.depth_timestamp_us - skew_us))
    recorded = Recorded(writer.path)
    assert recorded.pairs == 4
    assert recorded.shift_us == {DEPTH_NODE: 0, IMAGE_NODE: 0}


def test_more_frames_than_the_player_has_room_for_in_their_table(writer, monkeypatch):
    for number in range(3):
        writer.add(frame(number))
    monkeypatch.setattr(records, "MAX_IMAGE_BYTES", 70)
    writer.close()
    found = read_oni(writer.path)
    assert found.cut is None
    assert [(node.frames, node.seek_table_at) for node in found.nodes.values()] == [(3, 0), (3, 0)]


def test_a_sensor_without_color(writer):
    writer.add(without_color())
    writer.close()
    recorded = Recorded(writer.path)
    assert (recorded.color, recorded.pairs) == (None, 1)
    assert recorded.origin(DEPTH_US, 0).skew_known_by == ""


def test_no_frame_leaves_no_file(writer):
    writer.close()
    assert not writer.path.exists()


def test_a_file_that_is_there_stays(tmp_path):
    path = tmp_path / "take.oni"
    path.write_bytes(b"precious")
    with pytest.raises(FileExistsError):
        OniWriter(path)
    assert path.read_bytes() == b"precious"


OTHER = Calibration(depth=frames.camera(f=140.0), color=frames.camera())


@pytest.mark.parametrize("other", [
    lambda: frame(1, registered=True), lambda: frame(1, calibration=OTHER), without_color,
    lambda: frame(1, depth_meaning=DepthMeaning(100, DepthRounding.CUT)),
])
def test_a_frame_unlike_the_first_is_refused_and_the_file_goes_on(writer, other):
    writer.add(frame(0))
    with pytest.raises(FrameError, match="a frame differs from the first"):
        writer.add(other())
    writer.add(frame(1))
    writer.close()
    assert Recorded(writer.path).pairs == writer.frames == 2


@pytest.mark.parametrize(("changes", "words"), [
    ({"depth_meaning": DepthMeaning(250)}, "depth in 250 um; an .oni has 1000 or 100 um"),
    ({"depth_timestamp_us": -1}, "a time stamp of -1 us"),
])
def test_what_an_oni_cannot_hold_is_refused(writer, changes, words):
    with pytest.raises(FrameError, match=words):
        writer.add(replace(frame(), **changes))
    writer.close()
    assert not writer.path.exists()


def test_images_larger_than_openni2_plays(writer):
    camera = frames.camera(2000, 1500)
    large = replace(frame(), color=np.zeros((1500, 2000, 3), np.uint8),
                    calibration=frames.calibration(color=camera))
    with pytest.raises(FrameError, match="image of 2000x1500; OpenNI2 plays images of up to"):
        writer.add(large)


def test_more_depths_than_the_codec_knows(writer):
    camera = frames.camera(256, 256)
    many = RgbdFrame(np.arange(65536, dtype=np.uint16).reshape(256, 256), None, 0, 0,
                     Calibration(depth=camera, color=camera))
    with pytest.raises(FrameError, match="65536 different depths, at most 32767 can be stored"):
        writer.add(many)


@pytest.mark.parametrize("fails_at", range(1, 8))
def test_a_disk_that_fills_at_each_write(tmp_path, monkeypatch, fails_at):
    """Some bytes are written, then none: the frames before can be read, whatever was being done."""
    writes = 0
    real = os.pwrite

    def pwrite(descriptor, data, at):
        nonlocal writes
        writes += 1
        if writes == fails_at:
            real(descriptor, bytes(data)[:len(data) // 2], at)
        if writes >= fails_at:
            raise OSError(28, "No space left on device")
        return real(descriptor, data, at)

    monkeypatch.setattr(os, "pwrite", pwrite)
    writer = OniWriter(tmp_path / "take.oni")
    for number in range(3):
        try:
            writer.add(frame(number))
        except OSError:
            break
    if writer.frames:
        with pytest.raises(OSError, match=r"No space left on device: .*oni'$"):
            writer.close()
    writer.close()
    if fails_at == 1:
        assert not writer.path.exists()
        return
    recorded = Recorded(writer.path)
    assert recorded.pairs == writer.frames == min(fails_at - 1, 3)
    assert what_is_missing(recorded.file) is None


@pytest.mark.parametrize("call", ["fsync", "close"])
def test_a_recording_that_may_not_be_on_the_disk_is_told(writer, monkeypatch, call):
    writer.add(frame(0))
    real, calls = getattr(os, call), []

    def fails(descriptor):
        calls.append(descriptor)
        real(descriptor)
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as patch:
        patch.setattr(os, call, fails)
        with pytest.raises(OSError, match=r"Input/output error: .*\.oni'$"):
            writer.close()
    writer.close()
    assert len(calls) == 1
    assert Recorded(writer.path).pairs == 1


@pytest.mark.parametrize("text", [
    "{", "[]", "{}", '{"captured_at": "yesterday"}', '{"sensor": "\\u0000"}'])
def test_a_description_that_is_none(writer, text):
    writer.add(frame())
    writer.close()
    content = writer.path.read_bytes()
    name = records.counted(records.DESCRIPTION)
    at = content.index(name) + len(name)
    size, = struct.unpack_from("<I", content, at)
    changed = text.encode().ljust(size, b" ")
    writer.path.write_bytes(content[:at + 4] + changed + content[at + 4 + size:])
    with pytest.raises(UnreadableSourceError, match=r"take\.oni: its description: "):
        Recorded(writer.path)
