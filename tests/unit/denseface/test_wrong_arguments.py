"""What people pass by mistake is named in one line: the argument, what it was, what is expected."""

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import denseface as d
from tests.unit.service.faces import small_face, small_frame

FACE, FRAME = small_face(), small_frame()
DEPTH, COLOR, CALIBRATION = FRAME.depth, FRAME.color, FRAME.calibration
CAMERA = {"width": 640, "height": 480, "fx": 575.0, "fy": 575.0, "cx": 319.5, "cy": 239.5}
NOW = datetime(2026, 11, 29, 12)


class Picture:
    """As an image library's, or a tensor: it has numbers and is no array."""

    dtype, shape = "torch.uint16", (6, 8)


def frame(**changes):
    given = {"depth": DEPTH, "color": COLOR, "depth_timestamp_us": 0, "color_timestamp_us": 0,
             "calibration": CALIBRATION}
    return d.RgbdFrame(**{**given, **changes})


NO_PATH = "path: expected str or Path, found "
WRONG = [
    (lambda: frame(depth=Picture()),
     "depth must be a (H, W) uint16 array, found Picture of torch.uint16 (6, 8): np.asarray makes "
     "one of what holds numbers"),
    (lambda: frame(calibration=None), "calibration must be Calibration, found None"),
    (lambda: frame(calibration="c.json"), "calibration must be Calibration, found str 'c.json'"),
    (lambda: frame(calibration={}), "calibration must be Calibration, found dict"),
    (lambda: frame(calibration=CALIBRATION.depth),
     "calibration must be Calibration, found CameraModel"),
    (lambda: frame(depth_timestamp_us=None),
     "depth_timestamp_us must be a whole number, found None"),
    (lambda: frame(color_timestamp_us=0.5),
     "color_timestamp_us must be a whole number, found float 0.5"),
    (lambda: frame(color_timestamp_us=NOW), "color_timestamp_us must be a whole number, found "
                                            "datetime"),
    (lambda: frame(depth_timestamp_us=2**63),
     "depth_timestamp_us must fit into 64 bits, found 9223372036854775808"),
    (lambda: frame(registered="yes"), "registered must be bool, found str 'yes'"),
    (lambda: frame(depth_meaning=1000), "depth_meaning must be DepthMeaning, found int 1000"),
    (lambda: frame(origin="S1"), "origin must be FrameOrigin, found str 'S1'"),
    (lambda: d.DepthMeaning(1.0), "depth_unit_um must be a whole number, found float 1.0"),
    (lambda: d.DepthMeaning("mm"), "depth_unit_um must be a whole number, found str 'mm'"),
    (lambda: d.DepthMeaning(0), "depth_unit_um must be 1 to 100000, found 0"),
    (lambda: d.DepthMeaning(max_mm="x"), "max_mm must be a whole number, found str 'x'"),
    (lambda: d.DepthMeaning(1000, "up"),
     "depth_rounding must be cut, round, none, found str 'up'"),
    (lambda: d.FrameOrigin(None), "sensor must be str, found None"),
    (lambda: d.FrameOrigin("S1", NOW), "captured_at must be str, found datetime: its isoformat()"),
    (lambda: d.FrameOrigin(fused="2"), "fused must be a whole number, found str '2'"),
    (lambda: d.reconstruct(None),
     "frame: expected RgbdFrame, found None: iterating over open_source(uri) gives some"),
    (lambda: d.reconstruct("face.oni"),
     "frame: expected RgbdFrame, found str 'face.oni': iterating over open_source(uri) gives some"),
    (lambda: d.reconstruct(DEPTH), "frame: expected RgbdFrame, found ndarray of uint16 (6, 8): "
                                   "iterating over open_source(uri) gives some"),
    (lambda: d.reconstruct([FRAME]),
     "frame: expected RgbdFrame, found list: iterating over open_source(uri) gives some"),
    (lambda: d.reconstruct(FRAME, "best"),
     "settings: expected Settings, found str 'best': Settings.of(preset) makes some"),
    (lambda: d.reconstruct(FRAME, {"ratio": 5}),
     "settings: expected Settings, found dict: Settings.of(preset) makes some"),
    (lambda: d.reconstruct(FRAME, d.Settings),
     "settings: expected Settings, found the class Settings: Settings.of(preset) makes some"),
    (lambda: d.fuse(FRAME), "frames: expected Sequence, found RgbdFrame"),
    (lambda: d.fuse([FRAME, FACE]), "frames: expected RgbdFrame, found Face"),
    (lambda: d.fuse([]), "a burst has 1 to 32 frames, found 0"),
    (lambda: d.measure(FACE.dense), "face: expected Face, found DenseCloud"),
    (lambda: d.render(FRAME), "face: expected Face, found RgbdFrame"),
    (lambda: d.draw_refusal(FACE, (), ""), "frame: expected RgbdFrame, found Face"),
    (lambda: d.save_face("f.ply", FACE),
     "face: expected Face, found str 'f.ply': save_face(face, path)"),
    (lambda: d.save_face(FACE.dense, "f.ply"),
     "face: expected Face, found DenseCloud: save_face(face, path)"),
    (lambda: d.save_face(FACE, None), NO_PATH + "None"),
    (lambda: d.save_face(FACE, 5), NO_PATH + "int 5"),
    (lambda: d.save_face(FACE, b"f.ply"), NO_PATH + "bytes b'f.ply'"),
    (lambda: d.save_face(FACE, "f.jpg"),
     "f.jpg: ending .jpg, expected one of .ply .pcd .npz .obj .glb .stl .3mf "
     ".png .webp .mp4"),
    (lambda: d.save_frame("f.npz", FRAME),
     "frame: expected RgbdFrame, found str 'f.npz': save_frame(frame, path)"),
    (lambda: d.save_frame(FACE, "f.npz"),
     "frame: expected RgbdFrame, found Face: save_frame(frame, path)"),
    (lambda: d.save_frame(FRAME, ["f.npz"]), NO_PATH + "list"),
    (lambda: d.save_frame(FRAME, "f.oni"), "f.oni: frames are written as .npz alone, found .oni"),
    (lambda: d.save_frame(FRAME, "f"), "f: frames are written as .npz alone, found no ending"),
    (lambda: d.load_frame(None), NO_PATH + "None"),
    (lambda: d.load_frame(5), NO_PATH + "int 5"),
    (lambda: d.load_frame("f.oni"), "f.oni: frames are read from .npz alone; open_source(path) "
                                    "reads recordings and folders"),
    (lambda: d.load_face(None), NO_PATH + "None"),
    (lambda: d.load_face("f.ply"), "f.ply: faces are read back from .npz alone: "
                                   "save_face(face, 'f.npz') keeps the whole face"),
    (lambda: d.load_face(""), ".: faces are read back from .npz alone: "
                              "save_face(face, 'face.npz') keeps the whole face"),
    (lambda: d.open_source(None), "uri: expected str or Path, found None"),
    (lambda: d.open_source(0), "uri: expected str or Path, found int 0"),
    (lambda: d.open_source(DEPTH), "uri: expected str or Path, found ndarray of uint16 (6, 8)"),
    (lambda: d.open_source("f.npz", 5),
     "calibration: expected Calibration, str or Path, found int 5"),
    (lambda: d.open_source("f.npz", {}),
     "calibration: expected Calibration, str or Path, found dict"),
    (lambda: d.open_source("f.npz", rotation=45),
     "rotation: expected 0, 90, 180 or 270 degrees, found 45"),
    (lambda: d.open_source("f.npz", rotation="90"),
     "rotation: expected 0, 90, 180 or 270 degrees, found '90'"),
    (lambda: d.load_calibration(5), NO_PATH + "int 5"),
    (lambda: d.Calibration.from_json("c.json"),
     "calibration: JSON: Invalid JSON: expected value at line 1 column 1: load_calibration(path) "
     "reads a file"),
    (lambda: d.Calibration.from_json(Path("c.json")),
     "calibration: JSON: JSON input should be string, bytes or bytearray, found 'c.json': "
     "load_calibration(path) reads a file"),
    (lambda: d.Calibration(depth=None), "depth: expected a CameraModel, or its fields by name, "
                                        "found None"),
    (lambda: d.CameraModel(width=640), "height: Field required"),
    (lambda: d.CameraModel(**CAMERA | {"width": "a"}),
     "width: expected a whole number, found 'a'"),
    (lambda: d.CameraModel(**CAMERA, k1=0),
     "k1: no such field, expected one of width, height, fx, fy, cx, cy, distortion"),
    (lambda: d.CameraModel(**CAMERA, distortion=[0, 0, 0, 0]), "distortion.4: Field required"),
    (lambda: d.DepthToColor(translation_mm=1),
     "translation_mm: expected a list, found 1"),
    (lambda: CALIBRATION.depth.project([1, 2]),
     "points must have shape (..., 3), found (2,)"),
    (lambda: d.PointCloud(None, None), "points must be an array, found None"),
    (lambda: d.PointCloud([[1, 2, 3]], COLOR), "points must be an array, found list"),
    (lambda: d.PointCloud(np.zeros((2, 3)), COLOR),
     "points must be float32 (2, 3), found float64 (2, 3)"),
    (lambda: d.Settings.of("best", ratio=None),
     "ratio: expected a number, found None"),
]


@pytest.mark.parametrize(("call", "line"), WRONG, ids=[line[:40] for _, line in WRONG])
def test_what_is_wrong_is_named_in_one_line(call, line):
    with pytest.raises((TypeError, ValueError, d.DensefaceError)) as caught:
        call()
    assert str(caught.value) == line


@pytest.fixture(scope="module")
def operator(tmp_path_factory):
    """Give one that no hub answers: what is wrong is named before anything is asked."""
    with d.Operator(f"ipc://{tmp_path_factory.mktemp('run')}/hub") as operator:
        yield operator


NO_ID = ": expected letters, digits, - and _, at most 64"
NO_ZONE = " has no zone: {0}.astimezone() takes it as of this machine's"
ASKED = [
    (lambda o: o.press(5), f"capture id 5{NO_ID}"),
    (lambda o: o.press("a b"), f"capture id 'a b'{NO_ID}"),
    (lambda o: o.press(timeout="1"), "timeout: expected seconds, found str '1'"),
    (lambda o: o.press(timeout=float("nan")), "timeout: expected seconds, found float nan"),
    (lambda o: o.press(gate="good"),
     "gate: expected 'off', 'wait', 'refuse' or 'best', found 'good'"),
    (lambda o: o.press(frames=0), "frames: expected at least 1, found 0"),
    (lambda o: o.press(consent="yes"),
     "consent: expected a Consent, or its fields by name, found 'yes'"),
    (lambda o: o.press(sensor=5), "sensor: expected a text, found 5"),
    (lambda o: o.get(None), f"capture id None{NO_ID}"),
    (lambda o: o.get("a", timeout=None), "timeout: expected seconds, found None"),
    (lambda o: o.get_frame("a b"), f"capture id 'a b'{NO_ID}"),
    (lambda o: o.withdraw("a b"), f"capture id 'a b'{NO_ID}"),
    (lambda o: o.status(timeout="5"), "timeout: expected seconds, found str '5'"),
    (lambda o: next(o.published(after="x")),
     "after: expected a sequence number, 0 or more, found 'x'"),
    (lambda o: next(o.published(after=-1)),
     "after: expected a sequence number, 0 or more, found -1"),
    (lambda o: next(o.published(last=0)),
     "last: expected at least 1, found 0"),
    (lambda o: next(o.published(since=NOW)), f"since: {NOW}{NO_ZONE.format('since')}"),
    (lambda o: next(o.faces(since="2026-01-01")),
     "since: expected datetime with a zone, found str '2026-01-01'"),
    (lambda o: next(o.published(since=NOW.date())),
     "since: expected datetime with a zone, found date"),
    (lambda o: next(o.published(after=1, last=2)),
     "expected at most one of after, last and since"),
    (lambda o: next(o.hints(timeout="x")), "timeout: expected seconds, found str 'x'"),
    (lambda o: o.purge(before=NOW), f"before: {NOW}{NO_ZONE.format('before')}"),
    (lambda o: o.purge(before="2026"), "before: expected datetime with a zone, found str '2026'"),
    (lambda o: o.purge(), "expected one of capture_id, before and everything"),
    (lambda o: o.purge(capture_id="a b"), f"capture id 'a b'{NO_ID}"),
    (lambda o: o.captures(51), "last: expected 1 to 50, found 51"),
    (lambda o: o.retry(None), f"capture id None{NO_ID}"),
    (lambda o: o.restart_sensor(None), "sensor: expected a text, found None"),
    (lambda _: d.Consent(text_version="1", language="en", at=NOW),
     f"at: expected a time with its zone, found '{NOW}'"),
]


@pytest.mark.parametrize(("call", "line"), ASKED, ids=[line[:40] for _, line in ASKED])
def test_what_is_wrong_is_named_before_the_hub_is_asked(operator, call, line):
    with pytest.raises((d.LocalProtocolError, ValueError)) as caught:
        call(operator)
    assert str(caught.value) == line


def test_what_people_have_is_taken_as_it_is():
    """NumPy's numbers, OpenCV's rows and columns, channels in reverse, a rounding by its name."""
    camera = d.CameraModel(width=np.int64(8), height=np.int32(6), fx=np.float32(10), fy=10, cx=4,
                           cy=3, distortion=np.zeros((1, 5)))
    pose = d.DepthToColor(rotation=np.eye(3), translation_mm=np.array([[-25.0], [0], [0]]))
    calibration = d.Calibration(depth=camera, color=CALIBRATION.color, depth_to_color=pose)
    meaning = d.DepthMeaning(1000, "cut")
    made = frame(color=np.ascontiguousarray(COLOR[..., ::-1])[..., ::-1], calibration=calibration,
                 depth_timestamp_us=np.uint64(5), registered=np.bool_(False), depth_meaning=meaning)
    assert meaning.offset_mm == 0.5
    assert made.calibration.depth_to_color.translation_mm == (-25, 0, 0)


def test_files_of_another_kind_are_named(tmp_path):
    frame_file, face_file, other = (tmp_path / name for name in ("r.npz", "f.npz", "o.npz"))
    d.save_frame(FRAME, frame_file)
    d.save_face(FACE, face_file)
    np.savez(other, depth=np.array([{}, 1], object))
    face = "is a face that save_face wrote, not a frame: load_face reads it"
    for load, path, line in [
            (d.load_face, frame_file,
             "is a frame, not a face: reconstruct(load_frame(path)) makes one"),
            (d.load_frame, face_file, face), (d.open_source, face_file, face),
            (d.load_frame, other, "depth: expected uint16 (H, W), found object (2,)"),
            (d.load_face, tmp_path / "nothing.npz", "No such file or directory")]:
        with pytest.raises(d.DensefaceError) as caught:
            load(path)
        assert str(caught.value) == f"{path}: {line}"
