import io
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from denseface.capture import open_source
from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.errors import CalibrationError, FrameError, UnreadableSourceError
from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin, RgbdFrame
from denseface.capture.npz import FolderWriter, load_frame, save_frame
from tests.unit import frames

H, W = 6, 8
CALIBRATION = frames.calibration(depth=frames.camera(W, H, 7.0), color=frames.camera(W, H, 7.0))


def good() -> dict[str, object]:
    return {
        "depth": np.full((H, W), 700, np.uint16), "color": np.full((H, W, 3), 9, np.uint8),
        "depth_timestamp_us": np.int64(5), "color_timestamp_us": np.int64(6),
        "calibration": np.array(CALIBRATION.to_json()),
    }


def write(path, **changes):
    entries = {k: v for k, v in (good() | changes).items() if v is not None}
    np.savez_compressed(path, allow_pickle=True, **entries)
    return path


@given(
    depth=arrays_of.arrays(np.uint16, (H, W)), color=arrays_of.arrays(np.uint8, (H, W, 3)),
    stamps=st.tuples(*[st.integers(-2**63, 2**63 - 1)] * 2), registered=st.booleans(),
    pose=frames.poses(),
)
@settings(deadline=None, max_examples=30, suppress_health_check=[
    HealthCheck.function_scoped_fixture])
def test_what_is_saved_is_loaded(tmp_path, depth, color, stamps, registered, pose):
    calibration = CALIBRATION.model_copy(update={"depth_to_color": pose})
    frame = RgbdFrame(depth, color, *stamps, calibration, registered)
    save_frame(frame, tmp_path / "f.npz")
    with open_source(tmp_path / "f.npz") as source:
        (loaded,) = source
        assert source.frame_count == 1
    np.testing.assert_array_equal(loaded.depth, depth)
    np.testing.assert_array_equal(loaded.color, color)
    assert (loaded.depth_timestamp_us, loaded.color_timestamp_us) == stamps
    assert loaded.registered == registered
    assert loaded.calibration == calibration
    assert loaded.calibration_origin == "npz file"
    assert [p.name for p in tmp_path.iterdir()] == ["f.npz"]


def test_what_a_depth_means_and_where_it_comes_from_is_kept(tmp_path):
    meaning = DepthMeaning(100, DepthRounding.NONE, 4000)
    frame = RgbdFrame(good()["depth"], None, 5, 5, CALIBRATION, depth_meaning=meaning,
                      origin=FrameOrigin("B00366600000000A", "2026-11-29T12:00:00Z",
                                         source="take.oni#3"))
    save_frame(frame, tmp_path / "f.npz")
    loaded = load_frame(tmp_path / "f.npz")
    assert loaded.color is None
    assert loaded.depth_meaning == meaning
    assert loaded.origin == frame.origin


def test_a_file_that_does_not_say_was_rounded(tmp_path):
    loaded = load_frame(write(tmp_path / "f.npz"))
    assert loaded.depth_meaning == DepthMeaning(1000, DepthRounding.ROUND)
    assert loaded.depth_meaning.offset_mm == 0


@pytest.mark.parametrize(("changes", "words"), [
    ({"depth_rounding": np.array("up")}, "depth_rounding must be cut, round, none, found 'up'"),
    ({"depth_max_mm": np.int64(0)}, "max_mm must be positive, found 0"),
    ({"depth_unit_um": np.int64(0)}, "depth_unit_um must be 1 to 100000, found 0"),
    ({"sensor": np.array("two\nlines")}, "sensor: expected one line"),
    ({"color": None}, "expected both or neither"),
    ({"color": None, "color_timestamp_us": None, "registered": np.bool_(True)},
     "there is no color to be registered to"),
])
def test_a_wrong_meaning_is_named(tmp_path, changes, words):
    with pytest.raises(FrameError, match=words):
        load_frame(write(tmp_path / "f.npz", **changes))


def complaint(path) -> str | None:
    try:
        load_frame(path)
    except (UnreadableSourceError, FrameError, CalibrationError) as error:
        return str(error)
    return None


def test_registered_is_optional_and_arrays_can_be_written_to(tmp_path):
    frame = load_frame(write(tmp_path / "f.npz"))
    assert frame.registered is False
    frame.depth[0, 0] = 1
    assert load_frame(write(tmp_path / "f.npz", registered=np.True_)).registered is True


def test_other_byte_and_memory_orders_are_understood(tmp_path):
    depth = np.arange(H * W).reshape(H, W)
    frame = load_frame(write(tmp_path / "f.npz", depth=np.asfortranarray(depth.astype(">u2"))
                             .astype("<u2", order="F")))
    np.testing.assert_array_equal(frame.depth, depth)


@pytest.mark.parametrize(("changes", "words"), [
    ({"depth": None}, ["'depth'", "missing"]),
    ({"color_timestamp_us": None}, ["'color_timestamp_us'", "missing"]),
    ({"calibration": None}, ["'calibration'", "missing"]),
    ({"depth": np.zeros((H, W), np.float32)}, ["depth", "uint16", "float32"]),
    ({"depth": np.zeros((H, W, 1), np.uint16)}, ["depth", "(H, W)", "(6, 8, 1)"]),
    ({"depth": np.zeros((0, W), np.uint16)}, ["depth", "(0, 8)"]),
    ({"depth": np.zeros((H, W + 1), np.uint16)}, ["depth", "9x6", "8x6"]),
    ({"color": np.zeros((H, W, 4), np.uint8)}, ["color", "(6, 8, 4)"]),
    ({"depth_timestamp_us": np.float64(1)}, ["depth_timestamp_us", "int64", "float64"]),
    ({"calibration": np.array({"a": 1})}, ["calibration", "object"]),
    ({"calibration": np.array(b"{}")}, ["calibration", "S2"]),
    ({"registered": np.int64(1)}, ["registered", "bool"]),
    ({"depth": np.array([[None]])}, ["depth", "object"]),
    ({"extra": np.zeros(1)}, ["extra.npy", "unexpected"]),
])
def test_wrong_contents_are_named(tmp_path, changes, words):
    path = write(tmp_path / "bad.npz", **changes)
    with pytest.raises(FrameError) as caught:
        load_frame(path)
    message = str(caught.value)
    assert all(word in message for word in ["bad.npz", *words])
    assert "\n" not in message


def test_a_bad_calibration_is_named(tmp_path):
    path = write(tmp_path / "bad.npz", calibration=np.array("{}"))
    with pytest.raises(CalibrationError, match=r"bad\.npz: calibration: depth"):
        load_frame(path)


@settings(deadline=None, max_examples=40, suppress_health_check=[
    HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_truncated_file_is_unreadable(tmp_path, data):
    whole = write(tmp_path / "w.npz").read_bytes()
    path = tmp_path / "t.npz"
    path.write_bytes(whole[:data.draw(st.integers(0, len(whole) - 1))])
    with pytest.raises(UnreadableSourceError, match=r"t\.npz"):
        load_frame(path)


@settings(deadline=None, max_examples=150, suppress_health_check=[
    HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_changed_byte_never_gives_another_kind_of_error(tmp_path, data):
    content = bytearray(write(tmp_path / "w.npz").read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    content[at] ^= data.draw(st.integers(1, 255))
    path = tmp_path / "c.npz"
    path.write_bytes(content)
    said = complaint(path)
    assert said is None or "c.npz" in said


def _member(path, header_shape, data_bytes):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<u2", "fortran_order": False, "shape": header_shape})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("depth.npy", header.getvalue() + bytes(data_bytes))
    return path


def test_a_bomb_is_refused_by_its_header(tmp_path):
    path = _member(tmp_path / "bomb.npz", (16384, 16384), 0)
    with pytest.raises(FrameError, match=r"bomb\.npz: depth.*at most"):
        load_frame(path)
    path = _member(tmp_path / "bomb.npz", (10**9, 10**9), 0)
    with pytest.raises(FrameError, match=r"bomb\.npz: depth"):
        load_frame(path)


@pytest.mark.parametrize("size", [2 * H * W - 1, 2 * H * W + 1, 50_000_000])
def test_data_must_be_as_long_as_the_header_says(tmp_path, size):
    path = _member(tmp_path / "long.npz", (H, W), size)
    with pytest.raises(UnreadableSourceError, match=r"long\.npz: depth.*needs 96 bytes"):
        load_frame(path)


def test_text_that_is_no_unicode(tmp_path):
    text = np.frombuffer(b"\xff\xff\xff\x7f" * 3, "<U3").reshape(())
    with pytest.raises((FrameError, CalibrationError), match=r"u\.npz: calibration"):
        load_frame(write(tmp_path / "u.npz", calibration=text))


def test_other_compressions_are_refused(tmp_path):
    path = write(tmp_path / "f.npz")
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(
            tmp_path / "l.npz", "w", zipfile.ZIP_LZMA) as packed:
        for name in archive.namelist():
            packed.writestr(name, archive.read(name))
    with pytest.raises(UnreadableSourceError, match=r"l\.npz: depth: zip compression 14"):
        load_frame(tmp_path / "l.npz")


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 no more"])
def test_no_zip_at_all(tmp_path, content):
    path = tmp_path / "no.npz"
    path.write_bytes(content)
    with pytest.raises(UnreadableSourceError, match=r"no\.npz: no \.npz file, or one that is dam"):
        load_frame(path)


def test_pickles_are_not_run(tmp_path):
    class Bad:
        def __reduce__(self):
            return (pytest.fail, ("a pickle was run",))

    path = write(tmp_path / "p.npz", depth=np.array([[Bad()]], dtype=object))
    with pytest.raises(FrameError, match="object"):
        load_frame(path)


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch):
    path = write(tmp_path / "f.npz")
    old = path.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", fail)
    with pytest.raises(OSError, match="No space"):
        save_frame(frames.frame(np.zeros((H, W), np.uint16), np.zeros((H, W, 3), np.uint8),
                                CALIBRATION), path)
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


def test_a_depth_registered_at_another_resolution_than_the_colour(tmp_path):
    """Of VGA depth in the pixels of a camera of 1280x1024, halved: its upper 960 rows."""
    color = CameraModel(width=1280, height=1024, fx=1050, fy=1050, cx=639.5, cy=479.5)
    path = tmp_path / "f.npz"
    np.savez(path, depth=np.full((480, 640), 700, np.uint16), depth_timestamp_us=np.int64(0),
             color=np.zeros((1024, 1280, 3), np.uint8), color_timestamp_us=np.int64(0),
             registered=np.True_,
             calibration=np.array(Calibration(depth=color, color=color).to_json()))
    frame = load_frame(path)
    camera = frame.depth_camera
    assert (camera.width, camera.height, camera.fx, camera.cy) == (640, 480, 525, 239.5)
    assert frame.depth_to_color == DepthToColor()
    assert frame.origin.notes == ()


def test_calibration_of_another_size_names_both(tmp_path):
    path = write(tmp_path / "f.npz")
    camera = frames.camera().model_copy(update={"height": 100})
    (tmp_path / "f.calibration.json").write_text(Calibration(depth=camera, color=camera).to_json())
    with pytest.raises(CalibrationError,
                       match=r"f\.npz: .* of 160x100, the image is 8x6.*f\.calibration\.json"):
        open_source(path)


def test_a_folder_of_frames_is_written(tmp_path):
    folder = tmp_path / "take"
    writer = FolderWriter(folder)
    made = frames.frame(np.full((120, 160), 700, np.uint16), np.zeros((120, 160, 3), np.uint8))
    for _ in range(2):
        writer.add(made)
    writer.close()
    assert sorted(path.name for path in folder.iterdir()) == ["000000.npz", "000001.npz"]
    np.testing.assert_array_equal(load_frame(folder / "000001.npz").depth, made.depth)
    with pytest.raises(FileExistsError, match="Holds frame files already"):
        FolderWriter(folder)


def test_a_folder_that_was_made_for_nothing_is_removed(tmp_path):
    FolderWriter(tmp_path / "new").close()
    assert list(tmp_path.iterdir()) == []
    FolderWriter(tmp_path).close()
    assert tmp_path.is_dir()
