import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from denseface.capture.errors import UnreadableSourceError
from denseface.capture.openni2._oni_file import DEPTH_NODE, IMAGE_NODE, check_oni, written_frames


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
        *(record(0x0A, node, bytes(12), b"x" * 50) for node in (1, 2, 1)),
        record(0x0B, 0),
    ])


def test_nodes_frames_and_properties(tmp_path):
    path = tmp_path / "a.oni"
    path.write_bytes(recording(number(1, "AlternativeViewPoint", 1)) + bytes(1000))
    (depth, image), end = check_oni(path)
    assert (depth.kind, depth.frames, depth.registered) == (DEPTH_NODE, 2, True)
    assert (image.kind, image.frames, image.registered) == (IMAGE_NODE, 1, False)
    assert depth.properties["xnMirror"] == 1
    assert end == path.stat().st_size - 1000


def test_depth_as_the_depth_camera_sees_it(tmp_path):
    path = tmp_path / "a.oni"
    path.write_bytes(recording(number(1, "AlternativeViewPoint", 0)))
    assert not check_oni(path)[0][0].registered


@pytest.mark.parametrize(("content", "words"), [
    (b"", "empty"),
    (b"hello, I am not a recording at all", "not an .oni recording"),
    (b"NI10", "ends after 4 bytes"),
    (recording()[:-1], "without an end record"),
    (recording()[:200], "ends after 200 bytes"),
    (recording().replace(b"NIR\0", b"XXXX"), "damaged at byte 24"),
    (recording().replace(b"xnMirror", b"xnM\xffrror"), "no valid name"),
    (recording().replace(b"xnMirror\0", b"xnMirror!"), "no valid name"),
])
def test_what_is_wrong_is_said(tmp_path, content, words):
    path = tmp_path / "bad.oni"
    path.write_bytes(content)
    with pytest.raises(UnreadableSourceError) as caught:
        check_oni(path)
    assert "bad.oni: " in str(caught.value)
    assert words in str(caught.value)


def test_written_frames_while_a_recorder_is_at_work(tmp_path):
    path = tmp_path / "part.oni"
    assert written_frames(path) == 0
    whole = recording()
    path.write_bytes(whole[:-28 - 90] + bytes(5000))
    assert written_frames(path) == 1
    path.write_bytes(whole[:200])
    assert written_frames(path) == 0


def complaint(path) -> str | None:
    try:
        check_oni(path)
    except UnreadableSourceError as error:
        return str(error)
    return None


def test_a_missing_file(tmp_path):
    with pytest.raises(UnreadableSourceError, match=r"none\.oni: No such file"):
        check_oni(tmp_path / "none.oni")


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
