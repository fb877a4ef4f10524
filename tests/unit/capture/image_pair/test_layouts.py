"""Folders as data sets have them."""

import json

import numpy as np
import pytest

from denseface.capture import open_source
from denseface.capture.errors import CalibrationError, CaptureError, UnreadableSourceError
from denseface.capture.image_pair import FolderSource, PairReading
from tests.unit.capture.image_pair.files import COLOR, DEPTH, write

VGA = np.kron(DEPTH, np.ones((10, 10), np.uint16))
VGA_COLOR = np.kron(COLOR, np.ones((10, 10, 1), np.uint8))


def tum(folder, *, associated):
    """Three depths and colours, 12 ms apart, and one colour that has no partner."""
    times = [1305031102.16, 1305031102.19, 1305031102.23]
    for number, time in enumerate(times):
        write(folder / f"depth/{time:.6f}.png", (VGA * 5).astype(np.uint16))
        write(folder / f"rgb/{time + 0.012:.6f}.png", VGA_COLOR + np.uint8(number))
    write(folder / "rgb/1305031103.000000.png", VGA_COLOR)
    if associated:
        (folder / "associations.txt").write_text("".join(
            f"{time + 0.012:.6f} rgb/{time + 0.012:.6f}.png {time:.6f} depth/{time:.6f}.png\n"
            for time in times[1:]))
        return
    for name, lag, more in (("depth", 0, []), ("rgb", 0.012, [1305031103.0])):
        (folder / f"{name}.txt").write_text("# timestamp filename\n# x\n# y\n" + "".join(
            f"{time + lag:.6f} {name}/{time + lag:.6f}.png\n" for time in [*times, *more]))


@pytest.mark.parametrize(("associated", "count"), [(False, 3), (True, 2)])
def test_tum(tmp_path, associated, count):
    tum(tmp_path / "rgbd_dataset_freiburg1_xyz", associated=associated)
    with open_source(tmp_path / "rgbd_dataset_freiburg1_xyz") as source:
        frames = list(source)
        assert source.frame_count == len(frames) == count
    frame = frames[0]
    np.testing.assert_array_equal(frame.depth, VGA)
    assert frame.depth_meaning.unit_um == 1000
    assert frame.depth_meaning.rounding == "cut"
    assert frame.registered
    assert frame.skew_us == -12_000
    assert frame.origin.captured_at.startswith("2011-05-10T12:38:22.1")
    assert frame.calibration.color.fx == 525
    assert frame.origin.notes == ()
    assert frames[1].color[0, 0, 0] == COLOR[0, 0, 0] + 2 - (not associated)


def test_tum_freiburg3_has_cameras_of_its_own(tmp_path):
    tum(tmp_path / "rgbd_dataset_freiburg3_sitting_xyz", associated=False)
    frame = next(iter(FolderSource(tmp_path / "rgbd_dataset_freiburg3_sitting_xyz")))
    assert frame.calibration.color.fy == 539.2
    assert "freiburg3" in frame.calibration_origin


@pytest.mark.parametrize(("row", "found"), [
    ("1305031102.1 ../../etc/passwd", "is outside the folder"),
    ("1305031102.1 /etc/passwd", "is outside the folder"),
    ("soon depth/1.png", "'soon', expected seconds"),
    ("nan depth/1.png", "expected seconds"),
    ("1305031102.1", "expected time FILE"),
])
def test_a_list_that_is_wrong_is_named_with_its_row(tmp_path, row, found):
    tum(tmp_path, associated=False)
    (tmp_path / "depth.txt").write_text(f"# a comment\n{row}\n")
    with pytest.raises(UnreadableSourceError, match=rf"depth\.txt, line 2: .*{found}"):
        FolderSource(tmp_path)


def test_a_missing_file_of_a_list_is_named(tmp_path):
    tum(tmp_path, associated=True)
    next((tmp_path / "depth").glob("*.19*")).unlink()
    with pytest.raises(UnreadableSourceError, match=r"depth/1305031102\.19.*No such file"):
        next(iter(FolderSource(tmp_path)))


def scannet(folder, *, extrinsic=None):
    for number in (2, 10, 0):
        write(folder / f"depth/{number}.png", VGA + (VGA > 0) * np.uint16(number))
        write(folder / f"color/{number}.jpg", np.zeros((968, 1296, 3), np.uint8))
        write(folder / f"pose/{number}.txt.npy", DEPTH)
    (folder / "intrinsic").mkdir()
    for name, fx in (("depth", 577.87), ("color", 1170.19)):
        (folder / f"intrinsic/intrinsic_{name}.txt").write_text(
            f"{fx} 0.0 319.5 0.0\n0.0 {fx} 239.5 0.0\n0 0 1 0\n0 0 0 1\n")
        (folder / f"intrinsic/extrinsic_{name}.txt").write_text(
            extrinsic if extrinsic and name == "color" else "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1")


def test_scannet(tmp_path):
    scannet(tmp_path, extrinsic="1 0 0 0.04 0 1 0 0 0 0 1 0 0 0 0 1")
    source = FolderSource(tmp_path)
    frames = list(source)
    assert [int(frame.depth.max() - VGA.max()) for frame in frames] == [0, 2, 10]
    frame = frames[0]
    assert not frame.registered
    assert (frame.calibration.depth.fx, frame.calibration.color.fx) == (577.87, 1170.19)
    assert frame.calibration.depth_to_color.translation_mm == (-40, 0, 0)
    assert frame.origin.notes == ()
    assert next(source.frames_from(2)).depth_timestamp_us == 2 * 33_333


def test_scannet_frames_25k(tmp_path):
    scannet(tmp_path)
    for name in ("depth", "color"):
        (tmp_path / f"intrinsic/intrinsic_{name}.txt").rename(tmp_path / f"intrinsics_{name}.txt")
        (tmp_path / f"intrinsic/extrinsic_{name}.txt").unlink()
    (tmp_path / "intrinsic").rmdir()
    frame = next(iter(FolderSource(tmp_path)))
    assert frame.calibration.color.fx == 1170.19
    assert "ScanNet" in frame.calibration_origin


@pytest.mark.parametrize(("name", "text", "found"), [
    ("intrinsic_depth.txt", "1 2 3", r"expected a matrix of 4 x 4 numbers"),
    ("intrinsic_color.txt", "0 " * 16, "are of no camera of 1296x968"),
    ("extrinsic_color.txt", "0 " * 16, "are no poses"),
])
def test_scannet_matrices_that_are_none_are_named(tmp_path, name, text, found):
    scannet(tmp_path)
    (tmp_path / "intrinsic" / name).write_text(text)
    with pytest.raises(CalibrationError, match=found):
        FolderSource(tmp_path)
    (tmp_path / "intrinsic/intrinsic_depth.txt").unlink()
    with pytest.raises(CalibrationError, match=r"intrinsic_depth\.txt: No such file|intrinsic"):
        FolderSource(tmp_path)


def test_open3d_recordings_bring_their_camera(tmp_path):
    for number in range(2):
        write(tmp_path / f"depth/{number:06}.png", VGA)
        write(tmp_path / f"color/{number:06}.jpg", VGA_COLOR)
    (tmp_path / "camera_intrinsic.json").write_text(json.dumps(
        {"width": 640, "height": 480, "intrinsic_matrix": [615, 0, 0, 0, 616, 0, 320, 241, 1]}))
    frame = next(iter(FolderSource(tmp_path, reading=PairReading(unit_mm=1.0))))
    camera = frame.calibration.color
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (615, 616, 320, 241)
    assert frame.registered
    assert frame.origin.notes == ()


def test_two_folders_are_paired_by_names_or_by_numbers(tmp_path):
    for number in (1, 2, 3):
        write(tmp_path / f"depth/depth_{number:04}.png", VGA + (VGA > 0) * np.uint16(number))
        write(tmp_path / f"rgb/img-{number}.png", VGA_COLOR)
    (tmp_path / "rgb/img-2.png").unlink()
    frames = list(FolderSource(tmp_path))
    assert [int(frame.depth.max() - VGA.max()) for frame in frames] == [1, 3]
    assert len(frames[0].origin.notes) == 3  # unit, registered, cameras


@pytest.mark.parametrize(("depth", "color"), [
    ("frame-000000.depth.png", "frame-000000.color.png"), ("a_depth.npy", "a_rgb.jpg"),
    ("depth7.tiff", "color7.webp")])
def test_pairs_of_one_folder(tmp_path, depth, color):
    write(tmp_path / depth, VGA)
    write(tmp_path / color, VGA_COLOR)
    (tmp_path / "frame-000000.pose.txt").write_text("1 0 0 0")
    frame, = FolderSource(tmp_path)
    assert frame.color.shape == (480, 640, 3)


def test_a_calibration_that_is_given_wins(tmp_path):
    scannet(tmp_path / "scene")
    own = next(iter(FolderSource(tmp_path / "scene"))).calibration
    mine = own.model_copy(update={"depth": own.depth.model_copy(update={"fx": 600.0})})
    with open_source(tmp_path / "scene", mine) as source:
        assert next(iter(source)).calibration == mine
    (tmp_path / "scene.calibration.json").write_text(mine.to_json())
    with open_source(tmp_path / "scene") as source:
        assert next(iter(source)).calibration_origin == "beside: scene.calibration.json"


@pytest.mark.parametrize("names", [
    [], ["a.png"], ["depth/1.png"], ["depth/1.png", "rgb/2.png"], ["depth/1.txt", "rgb/1.png"],
    ["depth/1.png", "rgb/1.png", "color/1.png"], ["1.depth.png", "1.color.png", "1.rgb.png"]])
def test_a_folder_that_fits_no_layout_is_refused_in_a_line(tmp_path, names):
    folder = tmp_path / "data"
    folder.mkdir()
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(b"")
    with pytest.raises(CaptureError, match="data") as caught:
        FolderSource(folder)
    assert "\n" not in str(caught.value)
