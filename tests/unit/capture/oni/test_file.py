import struct
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from denseface.capture.errors import UnreadableSourceError
from denseface.capture.oni.file import read_oni
from denseface.capture.oni.records import DEPTH_NODE, IMAGE_NODE


def text(value: str) -> bytes:
    return struct.pack("<I", len(value) + 1) + value.encode() + b"\0"


def record(kind: int, node: int, fields: bytes = b"", payload: bytes = b"") -> bytes:
    return (struct.pack("<4s4IQ", b"NIR\0", kind, node, 28 + len(fields), len(payload), 0)
            + fields + payload)


def number(node: int, name: str, value: int) -> bytes:
    return record(3, node, text(name) + struct.pack("<IQ", 8, value))


def recording(*extra: bytes) -> bytes:
    return b"".join([
        struct.pack("<4sBBHIQI", b"NI10", 1, 0, 1, 0, 99, 2),
        record(0x0D, 1, text("Depth1") + struct.pack("<I", 2) + b"16zT" + bytes(20)),
        record(0x0D, 2, text("Image1") + struct.pack("<I", 3) + b"JPEG" + bytes(20)),
        number(1, "xnMirror", 1), *extra,
        *(record(0x0A, node, struct.pack("<QI", stamp, stamp), b"x" * 50)
          for stamp, node in enumerate((1, 2, 1))),
        record(0x0B, 0),
    ])


def written(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "a.oni"
    path.write_bytes(content)
    return path


def test_nodes_frames_and_properties(tmp_path):
    content = recording(number(1, "AlternativeViewPoint", 1))
    found = read_oni(written(tmp_path, content + bytes(1000)))
    depth, image = found.nodes.values()
    assert (depth.kind, depth.frames, depth.registered) == (DEPTH_NODE, 2, True)
    assert (image.kind, image.frames, image.registered) == (IMAGE_NODE, 1, False)
    assert depth.properties["xnMirror"] == 1
    assert (found.end, found.cut, found.max_node) == (len(content), None, 2)
    assert list(found.order) == [DEPTH_NODE, IMAGE_NODE, DEPTH_NODE]
    assert list(found.stamps_us) == [0, 1, 2]


def test_depth_as_the_depth_camera_sees_it(tmp_path):
    found = read_oni(written(tmp_path, recording(number(1, "AlternativeViewPoint", 0))))
    assert not found.nodes[1].registered


FRAME = 28 + 12 + 50
END = 28


@pytest.mark.parametrize(("content", "frames", "words"), [
    (recording()[:-1], 3, "without an end record"),
    (recording()[:-END], 3, "without an end record"),
    (recording()[:-END - 1], 2, "in the middle of a record"),
    (recording()[:-END - FRAME + 1], 2, "without an end record"),
    (recording()[:-END - 2 * FRAME], 1, "without an end record"),
    (recording()[:-END] + bytes(5000), 3, "no valid record there"),
])
def test_what_was_whole_before_a_cut_is_found(tmp_path, content, frames, words):
    found = read_oni(written(tmp_path, content))
    assert words in found.cut
    assert found.end == len(recording()) - END - (3 - frames) * FRAME
    assert len(found.order) == frames == sum(node.frames for node in found.nodes.values())


@pytest.mark.parametrize("content", [
    recording(record(0x0A, 1, struct.pack("<QI", 2**63, 9))),
    recording(record(0x0A, 1, struct.pack("<Q", 5))),
])
def test_a_frame_without_a_time_stamp_is_damage(tmp_path, content):
    with pytest.raises(UnreadableSourceError, match="a frame has no time stamp"):
        read_oni(written(tmp_path, content))


@pytest.mark.parametrize(("content", "words"), [
    (b"", "empty"),
    (b"hello, I am not a recording at all", "not an .oni recording"),
    (b"NI10", "ends after 4 bytes"),
    (recording()[:-END - 3 * FRAME], "without an end record"),
    (recording()[:200], "ends after 200 bytes"),
    (recording().replace(b"NIR\0", b"XXXX"), "damaged at byte 24"),
    (recording().replace(b"xnMirror", b"xnM\xffrror"), "no valid name"),
    (recording().replace(b"xnMirror\0", b"xnMirror!"), "no valid name"),
])
def test_what_is_wrong_is_said(tmp_path, content, words):
    path = tmp_path / "bad.oni"
    path.write_bytes(content)
    with pytest.raises(UnreadableSourceError) as caught:
        read_oni(path)
    assert "bad.oni: " in str(caught.value)
    assert words in str(caught.value)


def complaint(path) -> str | None:
    try:
        read_oni(path)
    except UnreadableSourceError as error:
        return str(error)
    return None


def test_a_missing_file(tmp_path):
    with pytest.raises(UnreadableSourceError, match=r"none\.oni: No such file"):
        read_oni(tmp_path / "none.oni")


@given(st.data())
@settings(deadline=None, max_examples=150, suppress_health_check=[
    HealthCheck.function_scoped_fixture])
def test_no_damage_gives_another_kind_of_error_or_hangs(tmp_path, data):
    content = bytearray(recording())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "x.oni"
    path.write_bytes(content[:data.draw(st.integers(0, len(content)))])
    said = complaint(path)
    assert said is None or "x.oni" in said
