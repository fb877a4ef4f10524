"""Messages: round trips, garbage, limits."""

import json
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, example, find, given, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample
from pydantic import ValidationError

from denseface.capture import MAX_BURST
from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin
from denseface.recon.face import Consent
from denseface.recon.settings import Preset, Settings
from denseface.service.errors import LocalProtocolError, ProtocolError, RemoteProtocolError
from denseface.service.protocol import messages, wire
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.message_base import CaptureSummary, DeadLetter
from denseface.service.protocol.payload import (
    MAX_ARRAY_BYTES,
    FaceHeader,
    FrameHeader,
    PreviewHeader,
)
from denseface.service.protocol.sensor_messages import (
    Gate,
    LiveStateName,
    SensorFigures,
)
from denseface.service.protocol.status import Restarts, SensorStatus
from denseface.service.protocol.wire import Packet, decode_from_hub, decode_to_hub, encode
from tests.unit.service.faces import jpeg, small_face, small_frame

FRAME, FRAME_ARRAYS = FrameHeader.of(small_frame())
FACE, FACE_ARRAYS = FaceHeader.of(small_face())
PREVIEW = PreviewHeader(width=4, height=3, timestamp_us=5)
PREVIEW_ARRAYS = {"image": np.arange(36, dtype=np.uint8).reshape(3, 4, 3)}
JPEG, JPEG_ARRAYS = PreviewHeader.of_jpeg(jpeg(4, 3), 5, Hint(
    timestamp_us=4, codes=("too_far",), text="come closer", measures={"distance_mm": 1400.0}))

ids = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", fullmatch=True)
numbers = st.integers(0, 2**63 - 1)
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=200)
peer_names = st.from_regex(r"[!-~]{1,100}", fullmatch=True)
hashes = st.from_regex(r"[0-9a-f]{1,64}", fullmatch=True)
digests = st.from_regex(r"[0-9a-f]{64}", fullmatch=True)
times = st.datetimes(datetime(1, 1, 2), datetime(9999, 12, 30), timezones=st.just(UTC))
codes = st.from_regex(r"[a-z][a-z0-9_]{0,15}", fullmatch=True)
hints = st.builds(
    Hint, timestamp_us=st.integers(-(2**63), 2**63 - 1), codes=st.lists(codes, max_size=8),
    text=st.text(st.characters(codec="ascii", min_codepoint=32), max_size=50),
    measures=st.dictionaries(codes, st.floats(-1e6, 1e6).map(lambda one: round(one, 3)),
                             max_size=5))
consents = st.builds(
    Consent, text_version=st.text(
        st.characters(exclude_categories=["Cs"]), min_size=1, max_size=64), at=times,
    language=st.sampled_from(["en", "de-CH", "zh-Hans-CN", "ar"]),
    retention_s=st.none() | st.floats(1e-3, 1e10))
GATED = {"gate": st.sampled_from(Gate.__args__), "gate_timeout": st.floats(0, 120),
         "frames": st.integers(1, MAX_BURST)}
DIGEST = "0f" * 32


def plain(kind, **fields):
    return st.builds(kind, **fields).map(Packet)


to_hub = st.one_of(
    plain(messages.Press, request=numbers, capture_id=ids),
    plain(messages.Press, request=numbers, capture_id=ids, sensor=peer_names, **GATED),
    plain(messages.Press, request=numbers, capture_id=ids, consent=consents),
    plain(messages.GetFace, request=numbers, capture_id=ids, wait_s=st.floats(0, 3600)),
    plain(messages.GetFrame, request=numbers, capture_id=ids),
    plain(messages.GetNext, request=numbers, after=numbers),
    plain(messages.FindStart, request=numbers, last=st.integers(1, 2**31 - 1)),
    plain(messages.FindStart, request=numbers, since=times),
    plain(messages.GetStatus, request=numbers),
    plain(messages.Withdraw, request=numbers, capture_id=ids),
    plain(messages.ListCaptures, request=numbers, last=st.integers(1, 50)),
    plain(messages.RestartSensor, request=numbers, sensor=peer_names),
    plain(messages.ListDead, request=numbers, after=numbers),
    plain(messages.RetryDead, request=numbers, capture_id=ids),
    plain(messages.DropDead, request=numbers, capture_id=ids),
    plain(messages.Purge, request=numbers, capture_id=ids),
    plain(messages.Purge, request=numbers, before=times),
    plain(messages.Purge, request=numbers, everything=st.just(True)),
    plain(messages.SensorReady, name=peer_names, source=texts),
    plain(messages.SensorState, name=peer_names, reason=texts, identity=texts,
          state=st.sampled_from(LiveStateName.__args__),
          figures=st.builds(SensorFigures, frames=numbers, skew_us=numbers)),
    plain(messages.QualityHint, hint=hints),
    plain(messages.WorkerReady, name=peer_names, credit=numbers),
    plain(messages.Heartbeat, holding=st.none() | ids),
    plain(messages.Heartbeat, compiling=st.builds(
        messages.Compiling, name=peer_names, done=numbers, total=numbers)),
    st.just(Packet(messages.Goodbye())),
    plain(messages.FrameFailed, capture_id=ids, message=texts),
    plain(messages.FrameFailed, capture_id=ids, message=texts, reason=st.just("quality"),
          hint=hints),
    plain(messages.JobFailed, capture_id=ids, settings_hash=hashes, frame_sha256=digests,
          error=texts, message=texts, final=st.booleans()),
    ids.map(lambda name: Packet(messages.Frame(capture_id=name, frame=FRAME), FRAME_ARRAYS)),
    ids.map(lambda name: Packet(
        messages.Result(capture_id=name, settings_hash="0f", frame_sha256=DIGEST, face=FACE),
        FACE_ARRAYS)),
    st.just(Packet(messages.PreviewFrame(preview=PREVIEW), PREVIEW_ARRAYS)),
    st.just(Packet(messages.PreviewFrame(preview=JPEG), JPEG_ARRAYS)),
)
from_hub = st.one_of(
    plain(messages.PressAccepted, request=numbers, capture_id=ids),
    plain(messages.PressRefused, request=numbers, capture_id=ids, message=texts,
          reason=st.sampled_from(messages.PressReason.__args__), hint=st.none() | hints),
    plain(messages.CapturePending, request=numbers, capture_id=ids),
    plain(messages.CaptureUnknown, request=numbers, capture_id=ids),
    plain(messages.RequestFailed, request=numbers, message=texts),
    plain(messages.NothingNewer, request=numbers, epoch=hashes, sequence=numbers),
    plain(messages.StartAt, request=numbers, epoch=hashes, sequence=numbers),
    plain(messages.CaptureList, request=numbers, captures=st.lists(st.builds(
        CaptureSummary, capture_id=ids, state=texts, accepted_at=texts, attempts=numbers,
        finished_at=st.none() | texts, sequence=st.none() | numbers, error=st.none() | texts,
        message=st.none() | texts, consent=st.none() | consents), max_size=5)),
    plain(messages.SensorRestarting, request=numbers, sensor=peer_names),
    st.just(Packet(messages.Restart())),
    plain(messages.Removed, request=numbers, removed=numbers, left=st.booleans()),
    plain(messages.DeadLetters, request=numbers, letters=st.lists(st.builds(
        DeadLetter, sequence=numbers, capture_id=ids, error=texts, message=texts,
        attempts=numbers, accepted_at=texts, finished_at=texts), max_size=3).map(tuple)),
    plain(messages.CaptureFailed, request=numbers, epoch=hashes, sequence=numbers, capture_id=ids,
          error=texts, message=texts, dead=st.booleans()),
    ids.map(lambda name: Packet(
        messages.FrameKept(request=1, capture_id=name, frame=FRAME), FRAME_ARRAYS)),
    plain(messages.Status, request=numbers, epoch=hashes, sequence=numbers, hub_version=texts,
          obstacle=texts, retention_s=st.none() | st.floats(1e-3, 1e9),
          heartbeat_s=st.floats(1e-3, 3600),
          sensors=st.lists(texts, max_size=3).map(tuple),
          workers=st.lists(texts, max_size=3).map(tuple), pressed=numbers, queued=numbers,
          working=numbers, done=numbers, failed=numbers, dead=numbers,
          refused=st.dictionaries(texts, numbers, max_size=3),
          presses_refused=st.dictionaries(texts, numbers, max_size=3),
          since_start=st.dictionaries(texts, numbers, max_size=3),
          latencies=st.dictionaries(texts, st.builds(
              messages.Latency, count=numbers, median_s=st.floats(0, 1e6),
              p99_s=st.floats(0, 1e6)), max_size=3),
          restarts=st.dictionaries(texts, st.builds(
              Restarts, exited=numbers, hung=numbers), max_size=3),
          free_bytes=st.none() | numbers, kept_bytes=st.none() | numbers, log_lines_lost=numbers,
          state=st.sampled_from(["serving", "rebuilding"]), files_read=numbers,
          files_to_read=numbers, sensor_states=st.lists(st.builds(
              SensorStatus, name=texts, state=texts, reason=texts, identity=texts,
              figures=st.builds(SensorFigures, drops=numbers)), max_size=3).map(tuple)),
    numbers.map(lambda number: Packet(messages.Preview(
        epoch="0f", sequence=number, preview=PREVIEW), PREVIEW_ARRAYS)),
    numbers.map(lambda number: Packet(messages.Preview(
        epoch="0f", sequence=number, preview=JPEG), JPEG_ARRAYS)),
    plain(messages.Hints, sensor=peer_names, hint=hints),
    st.just(Packet(messages.TakePreview())),
    plain(messages.TakeHints, seconds=st.floats(0.1, 3600)),
    st.just(Packet(messages.Announce())),
    plain(messages.Denied, message=texts),
    plain(messages.Take, capture_id=ids),
    plain(messages.Take, capture_id=ids, **GATED),
    plain(messages.FrameAccepted, capture_id=ids),
    plain(messages.FrameRefused, capture_id=ids, message=texts),
    st.builds(lambda name, preset: Packet(messages.Job(
        capture_id=name, attempt=1, settings=Settings.of(preset), settings_hash="0f",
        frame_sha256=DIGEST, frame=FRAME), FRAME_ARRAYS), ids, st.sampled_from(Preset)),
    ids.map(lambda name: Packet(messages.FaceDone(
        epoch="0f", sequence=3, capture_id=name, face=FACE), FACE_ARRAYS)),
)


def same(one: Packet, other: Packet) -> bool:
    return one.message == other.message and one.arrays.keys() == other.arrays.keys() and all(
        one.arrays[name].tobytes() == other.arrays[name].tobytes() for name in one.arrays)


@given(to_hub)
@settings(deadline=None)
def test_what_is_sent_to_the_hub_comes_out_the_same(packet):
    assert same(decode_to_hub(encode(packet)), packet)


@given(from_hub)
@settings(deadline=None)
def test_what_the_hub_sends_comes_out_the_same(packet):
    assert same(decode_from_hub(encode(packet)), packet)


@pytest.mark.parametrize(("packets", "kinds"), [
    (to_hub, messages.TO_HUB), (from_hub, messages.FROM_HUB)], ids=["to the hub", "from the hub"])
def test_every_kind_is_among_the_examples(packets, kinds):
    missing = set(kinds)

    def is_last(packet):
        missing.discard(type(packet.message))
        return not missing

    with suppress(NoSuchExample):
        find(packets, is_last, settings=settings(
            deadline=None, derandomize=True, database=None, max_examples=3000,
            phases=[Phase.generate]))
    assert not missing


@given(to_hub)
@settings(deadline=None, max_examples=30)
def test_messages_of_the_hub_are_not_taken_from_others(packet):
    with pytest.raises(RemoteProtocolError):
        decode_from_hub(encode(packet))


@given(st.lists(st.binary(max_size=300), max_size=20))
@example([])
@example([b"[" * 100_000])
@example([b'{"kind":"press","version":2,"request":' + b"9" * 5000 + b',"capture_id":"a"}'])
@example([b"\xff\xfe{}"])
@settings(deadline=None)
def test_garbage_is_a_protocol_error(parts):
    with pytest.raises(ProtocolError):
        decode_to_hub(parts)


WIRES = [encode(Packet(messages.Press(request=1, capture_id="a"))),
         encode(Packet(messages.Frame(capture_id="a", frame=FRAME), FRAME_ARRAYS)),
         encode(Packet(messages.Result(
             capture_id="a", settings_hash="0f", frame_sha256=DIGEST, face=FACE), FACE_ARRAYS))]


@given(st.sampled_from(WIRES), st.data())
@settings(deadline=None, max_examples=300)
def test_a_mutated_message_is_another_message_or_a_protocol_error(parts, data):
    parts = list(parts)
    index = data.draw(st.integers(0, len(parts) - 1))
    part = bytearray(parts[index])
    match data.draw(st.sampled_from(["flip", "cut", "drop", "repeat", "number"])):
        case "flip":
            for _ in range(data.draw(st.integers(1, 4))):
                part[data.draw(st.integers(0, len(part) - 1))] = data.draw(st.integers(0, 255))
        case "cut":
            del part[data.draw(st.integers(0, len(part) - 1)):]
        case "drop":
            part = None
        case "repeat":
            parts.insert(index, bytes(part))
        case "number":
            text = bytes(parts[0])
            digits = [i for i, one in enumerate(text) if 48 <= one <= 57]
            at = data.draw(st.sampled_from(digits))
            more = data.draw(st.sampled_from([b"99999999", b"-1", b"1e308", b"NaN", b"1e999"]))
            parts[0] = text[:at] + more + text[at + 1:]
            part = bytearray(parts[index])
    parts[index:index + 1] = [] if part is None else [bytes(part)]
    try:
        packet = decode_to_hub(parts)
    except ProtocolError:
        return
    assert same(decode_to_hub(encode(packet)), packet)


def header(**changes) -> bytes:
    return json.dumps(json.loads(WIRES[1][0]) | changes).encode()


def asked(kind: str, **fields) -> bytes:
    return json.dumps({"version": 2, "kind": kind, "request": 1} | fields).encode()


@pytest.mark.parametrize(("parts", "message"), [
    ([WIRES[0][0].replace(b'"version":2,', b"")], "no version"),
    ([WIRES[0][0].replace(b'"version":2', b'"version":1')], "version: found 1, expected 2"),
    ([WIRES[0][0].replace(b'"version":2', b'"version":3')], "version: found 3, expected 2"),
    ([WIRES[0][0].replace(b'"a"', b'"../a"')], "capture_id"),
    ([WIRES[0][0].replace(b'"a"', b'"a\\n"')], "capture_id"),
    ([WIRES[0][0].replace(b"}", b',"more":1}')], "press.more: no such field, found 1"),
    ([WIRES[0][0], b""], "1 arrays follow, 0 announced"),
    (WIRES[1][:2], "1 arrays follow, 2 announced"),
    ([WIRES[1][0], WIRES[1][1][:-1], WIRES[1][2]], "depth has 95 bytes, 96 announced"),
    ([b" " * (wire.MAX_HEADER_BYTES_TO_HUB + 1)], "header has"),
    ([asked("find_start")], "expected either last or since"),
    ([asked("find_start", last=1, since="2026-01-31T00:00:00Z")], "expected either last or since"),
    ([asked("find_start", since="2026-01-31T00:00:00")], "since: expected a time with its zone"),
    ([asked("find_start", since="0001-01-01T00:00:00+14:00")], "since: .* does not exist in UTC"),
    ([asked("find_start", since=1e300)], "since: "),
    ([asked("find_start", last=0)], "last: "),
    ([asked("purge")], "expected one of"),
    ([asked("purge", capture_id="a", everything=True)], "expected one of"),
    ([asked("purge", before="9999-12-31T23:59:59-14:00")], "before: .* does not exist in UTC"),
    ([b""] * (wire.MAX_PARTS + 1), "parts"),
    ([b"{}"], "kind: missing"),
    ([b"[]"], "header: expected a JSON object, found an array"),
    ([b"\xff{}"], "header: Invalid JSON: expected value at line 1 column 1"),
    ([b'{"kind":"press"'], "header: Invalid JSON: EOF while parsing"),
    ([asked("face_done")], "kind: found 'face_done', only the hub says that"),
    ([asked("fly")], "kind: found 'fly', no such kind of message"),
    ([asked("fly", version=3)], "version: found 3, expected 2"),
    ([asked("press", capture_id="../a")], r"press\.capture_id: expected letters, .* '\.\./a'"),
    ([asked("press", capture_id="a", frames=99)], "press.frames: expected at most 32, found 99"),
    ([asked("press", capture_id="a", frames=None)], "press.frames: expected .*, found null"),
    ([asked("press", capture_id="a", frames=[])], "press.frames: expected .*, found an array"),
    ([asked("press", capture_id="a" * 900)], f"found '{'a' * 60}'$"),
    ([asked("press")], "press.capture_id: Field required$"),
])
def test_what_is_wrong_is_named(parts, message):
    with pytest.raises(RemoteProtocolError, match=message):
        decode_to_hub(parts)


def test_an_oversized_claim_is_refused_by_its_header_alone():
    frame = json.loads(WIRES[1][0])["frame"]
    frame["calibration"]["color"] |= {
        "width": 16384, "height": 16384, "fx": 16384.0, "fy": 16384.0}
    frame["arrays"][1]["shape"] = [16384, 16384, 3]
    with pytest.raises(RemoteProtocolError, match=f"at most {MAX_ARRAY_BYTES}"):
        decode_to_hub([header(frame=frame), WIRES[1][1], WIRES[1][2]])


def test_arrays_that_contradict_the_calibration_are_refused():
    frame = json.loads(WIRES[1][0])["frame"]
    frame["arrays"][0]["shape"] = [8, 6]
    with pytest.raises(RemoteProtocolError, match="arrays must be depth"):
        decode_to_hub([header(frame=frame), *WIRES[1][1:]])


def test_wrong_arrays_are_not_sent():
    message = messages.Frame(capture_id="a", frame=FRAME)
    with pytest.raises(LocalProtocolError, match="arrays \\[\\] given"):
        encode(Packet(message))
    with pytest.raises(LocalProtocolError, match="depth is int32"):
        encode(Packet(message, FRAME_ARRAYS | {"depth": np.zeros((6, 8), np.int32)}))


def test_a_frame_without_colour_survives_with_its_meaning_and_origin():
    depth_alone = replace(
        small_frame(), color=None, depth_meaning=DepthMeaning(100, DepthRounding.CUT, 4000),
        origin=FrameOrigin("serial", "2026-11-29T12:00:00Z", 12.5, "stamps", "arrival", 3, ("a",)))
    header, arrays = FrameHeader.of(depth_alone)
    packet = decode_to_hub(encode(Packet(messages.Frame(capture_id="a", frame=header), arrays)))
    back = packet.message.frame.join(packet.arrays)
    assert back.color is None
    assert (back.depth_meaning, back.origin) == (depth_alone.depth_meaning, depth_alone.origin)


def test_frame_and_face_survive_the_wire():
    frame = small_frame()
    header, arrays = FrameHeader.of(frame)
    packet = decode_to_hub(encode(Packet(messages.Frame(capture_id="a", frame=header), arrays)))
    back = packet.message.frame.join(packet.arrays)
    np.testing.assert_array_equal(back.depth, frame.depth)
    np.testing.assert_array_equal(back.color, frame.rgb)
    assert (back.calibration, back.skew_us) == (frame.calibration, frame.skew_us)


@pytest.mark.parametrize(("name", "value", "words"), [
    ("initial_points", np.nan, "points must be finite"),
    ("dense_z", np.nan, "z must be finite"),
    ("dense_x", np.inf, "x must be finite"),
    ("dense_y", -np.inf, "y must be finite"),
    ("dense_sigma", 0, "sigma must be positive"),
    ("dense_sigma", -1, "sigma must be positive"),
    ("dense_sigma", np.nan, "sigma must be positive"),
    ("dense_sigma", np.inf, "sigma must be positive"),
    ("dense_support", 0, "support has 94 places for 102 points"),
    ("dense_support", 255, "support must lie on"),
])
@pytest.mark.parametrize("take", ["check", "join"])
def test_a_face_that_cannot_be_is_a_protocol_error(name, value, words, take):
    array = FACE_ARRAYS[name].copy()
    array[1, ...] = value
    with pytest.raises(RemoteProtocolError, match=f"face: {words}"):
        getattr(FACE, take)(FACE_ARRAYS | {name: array})


@pytest.mark.parametrize(("changes", "words"), [
    ({"grid_shape": [8192, 8192]}, "the grid has 8192 x 8192 places"),
    ({"dense_points": 2_600_000}, "both clouds have"),
])
def test_a_face_that_is_large_only_in_memory_is_refused_by_its_header(changes, words):
    tree = json.loads(WIRES[2][0])
    tree["face"] |= changes
    del tree["face"]["arrays"]
    with pytest.raises(RemoteProtocolError, match=words):
        decode_to_hub([json.dumps(tree).encode(), *WIRES[2][1:]])


def test_what_a_client_of_an_older_release_says_is_taken():
    press = decode_to_hub([asked("press", capture_id="a")]).message
    assert (press.sensor, press.gate, press.frames) == (None, "off", 1)
    failed = decode_to_hub([json.dumps({
        "kind": "frame_failed", "version": 2, "capture_id": "a", "message": "m"}).encode()]).message
    assert (failed.reason, failed.hint) == ("sensor", None)


@pytest.mark.parametrize(("message", "written"), [
    (messages.Press(request=1, capture_id="a"),
     {"version": 2, "kind": "press", "request": 1, "capture_id": "a"}),
    (messages.Take(capture_id="a"), {"version": 2, "kind": "take", "capture_id": "a"}),
    (messages.PressRefused(request=1, capture_id="a", reason="disk", message="m"),
     {"version": 2, "kind": "press_refused", "request": 1, "capture_id": "a", "reason": "disk",
      "message": "m"}),
])
def test_what_says_nothing_new_is_written_as_an_older_release_reads_it(message, written):
    (header,) = encode(Packet(message))
    assert json.loads(header) == written


def test_a_message_of_hints_stays_below_a_kilobyte():
    longest = messages.Hints(sensor="s" * 100, hint=Hint(
        timestamp_us=-(2**63), codes=tuple(f"code_{i}" for i in range(8)), text="w" * 200,
        measures={f"measure_{i}_mm": -1234.567 for i in range(18)}))
    assert 900 < len(encode(Packet(longest))[0]) < 1000
    with pytest.raises(ValidationError, match="at most 800 allowed"):
        Hint(timestamp_us=0, text="\N{SNOWMAN}" * 200, measures={
            f"measure_{i}_mm": -1234.567 for i in range(20)})


def test_a_status_of_another_release_can_be_read():
    given = {"kind": "status", "version": 2, "epoch": "0f", "sequence": 3, "hub_version": "9",
             "sensors": [], "workers": ["w"], "pressed": 0, "queued": 0, "working": 0, "done": 1,
             "failed": 0, "dead": 0}
    older = decode_from_hub([json.dumps(given).encode()]).message
    newer = decode_from_hub([json.dumps(given | {"mood": "fine"}).encode()]).message
    assert newer == older
    assert (older.workers, older.free_bytes, older.latencies, older.restarts) == (
        ("w",), None, {}, {})


def test_every_kind_stands_in_the_documentation():
    text = (Path(__file__).parents[4] / "docs" / "wire.md").read_text()
    for kind in (*messages.TO_HUB, *messages.FROM_HUB):
        assert f"`{kind.model_fields['kind'].default}`" in text


@pytest.mark.parametrize("timings", [
    {"x" * 195: 1.0}, {"total": -1.0}, {"rbf\n": 1.0}, {"total": 1e400}])
def test_a_face_has_times_of_known_stages_only(timings):
    tree = json.loads(WIRES[2][0])
    tree["face"]["report"]["timings_ms"] = timings
    with pytest.raises(RemoteProtocolError, match="timings_ms"):
        decode_to_hub([json.dumps(tree).encode(), *WIRES[2][1:]])
