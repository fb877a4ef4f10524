"""Calibration files of other programs, and ours as people write them."""

import codecs
import json
from contextlib import suppress

import cv2
import numpy as np
import pytest

from denseface.capture import Calibration, CameraModel, DepthToColor
from denseface.capture.calibration import ChosenCalibration
from denseface.capture.calibration_files import choose_calibration, read_calibration
from denseface.capture.doubts import doubts_of
from denseface.capture.errors import CalibrationError

K = np.array([[526.7, 0, 312.3], [0, 525.8, 246.2], [0, 0, 1]])
FIVE = (0.0186, -0.0808, 0.0007, -0.0018, 0.01)
ROS = f"""\
image_width: 640
image_height: 480
camera_name: rgb_PS1080_PrimeSense
camera_matrix:
  rows: 3
  cols: 3
  data: [526.7, 0., 312.3, 0., 525.8, 246.2,
         0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: {list(FIVE)}
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
"""
PAIR = Calibration(
    depth=CameraModel(width=640, height=480, fx=575.8, fy=575.8, cx=319.5, cy=239.5),
    color=CameraModel(width=640, height=480, fx=526.7, fy=525.8, cx=312.3, cy=246.2,
                      distortion=FIVE),
    depth_to_color=DepthToColor(translation_mm=(-23, 0, 0)))


def opencv(kind, coefficients=FIVE, **more):
    """Give what OpenCV's `FileStorage` writes, YAML or XML."""
    storage = cv2.FileStorage(f".{kind}", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    fields = {"image_width": 640, "image_height": 480, "camera_matrix": K,
              "distortion_coefficients": np.array([coefficients], float)}
    for name, value in (fields | more).items():
        if value is not None:
            storage.write(name, value)
    return storage.releaseAndGetString()


# As PyYAML's safe_dump writes a camera_info of ROS, and as `ros2 topic echo` prints the message.
PYYAML = f"""\
camera_matrix:
  cols: 3
  data:
  - 526.7
  - 0.0
  - 312.3
  - 0.0
  - 525.8
  - 246.2
  - 0.0
  - 0.0
  - 1.0
  rows: 3
distortion_coefficients:
  cols: 5
  data: {list(FIVE)}
  rows: 1
distortion_model: plumb_bob
image_height: 480
image_width: 640
"""
ECHO = f"""\
header:
  stamp:
    sec: 1
  frame_id: x
height: 480
width: 640
distortion_model: plumb_bob
d:
{"".join(f"- {value}" + chr(10) for value in FIVE)}k:
{"".join(f"- {value}" + chr(10) for value in K.ravel())}roi:
  do_rectify: false
---
"""


@pytest.mark.parametrize("text", [
    PYYAML, f"---\n# ours\n{PYYAML}...\n", ECHO, ECHO + ECHO, f"{ECHO}height: 1\n",
    ROS, f"\n# ours\n{ROS}", opencv("yml"), opencv("xml"), opencv("json")])
def test_one_camera_of_other_programs(tmp_path, text):
    (tmp_path / "camera.yaml").write_text(text)
    calibration, _, notes, _ = read_calibration(tmp_path / "camera.yaml")
    assert calibration.depth == calibration.color == PAIR.color
    note, = notes
    assert "describes one camera" in note
    assert doubts_of(calibration) != ()
    assert doubts_of(calibration, registered=True) == ()


def test_a_message_of_ros_and_an_intrinsic_of_open3d(tmp_path):
    (tmp_path / "m.yaml").write_text(f"height: 480\nwidth: 640\ndistortion_model: plumb_bob\n"
                                     f"D: {list(FIVE)}\nK: {K.ravel().tolist()}\n")
    assert read_calibration(tmp_path / "m.yaml").calibration.color == PAIR.color
    (tmp_path / "i.json").write_text(json.dumps(
        {"width": 640, "height": 480, "intrinsic_matrix": K.T.ravel().tolist()}))
    camera = read_calibration(tmp_path / "i.json").calibration.color
    assert camera == PAIR.color.model_copy(update={"distortion": (0,) * 5})
    (tmp_path / "c.json").write_text(json.dumps(
        {"image_width": 640, "image_height": 480, "camera_matrix": K.tolist(),
         "dist_coeffs": [list(FIVE)]}))
    assert read_calibration(tmp_path / "c.json").calibration.color == PAIR.color


@pytest.mark.parametrize("encode", [
    lambda text: codecs.BOM_UTF8 + text.encode(), lambda text: text.encode("utf-16"),
    lambda text: codecs.BOM_UTF16_BE + text.encode("utf-16-be")])
def test_a_byte_order_mark_is_left_out(tmp_path, encode):
    for name, text in (("our.json", PAIR.to_json()), ("ros.yaml", ROS)):
        (tmp_path / name).write_bytes(encode(text))
        assert read_calibration(tmp_path / name).calibration.color == PAIR.color
    (tmp_path / "f.calibration.json").write_bytes(encode(PAIR.to_json()))
    assert choose_calibration(tmp_path / "f.npz", None) == ChosenCalibration(
        PAIR, "beside: f.calibration.json")


def test_four_coefficients_leave_the_fifth_at_0(tmp_path):
    (tmp_path / "c.yml").write_text(opencv("yml", FIVE[:4]))
    assert read_calibration(tmp_path / "c.yml").calibration.color.distortion == (*FIVE[:4], 0)
    ours = json.loads(PAIR.to_json())
    ours["color"]["distortion"] = FIVE[:4]
    (tmp_path / "ours.json").write_text(json.dumps(ours))
    assert read_calibration(tmp_path / "ours.json").calibration.color.distortion == (*FIVE[:4], 0)


@pytest.mark.parametrize("eight", [
    (0.0186, -0.0808, 0.0007, -0.0018, 0.01, 0, 0, 0),
    # A depth camera of an Azure Kinect, near enough: large terms that nearly cancel.
    (3.13, 2.32, 0.00008, -0.00005, 0.13, 3.46, 3.35, 0.66)])
def test_eight_coefficients_are_replaced_by_the_closest_five(tmp_path, eight):
    (tmp_path / "c.yml").write_text(opencv("yml", eight, distortion_model="rational_polynomial"))
    camera = read_calibration(tmp_path / "c.yml").calibration.color
    pixels = np.stack(np.meshgrid(np.arange(0, 640, 20.0), np.arange(0, 480, 20.0)), -1)
    points = camera.back_project(pixels, 700.0).reshape(-1, 1, 3)
    theirs, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(eight))
    assert np.abs(theirs.reshape(pixels.shape) - pixels).max() < 0.26


@pytest.mark.parametrize(("text", "found"), [
    (opencv("yml", FIVE, image_width=None), "image_width is missing, found image_height"),
    (opencv("yml", FIVE, camera_matrix=None), "camera_matrix is missing, found image_width"),
    (opencv("yml", (0.1, 0.2, 0.3)), "has 3 distortion coefficients, expected 4, 5 or 8"),
    (opencv("yml", (*FIVE, 0, 0, 0, 0.01, 0, 0, 0)), "thin prism"),
    (opencv("yml", (-3.0, 40, 0, 0, 0, 8, 1, 0)), "8 coefficients"),
    (opencv("yml", FIVE, distortion_model="equidistant"), "'equidistant', expected plumb_bob"),
    (opencv("yml", FIVE[:4], fisheye_model=1), "'fisheye', expected plumb_bob"),
    (opencv("yml", FIVE, R=np.eye(3), T=np.zeros((3, 1))), "has a pose (T) and one camera"),
    ("cam0:\n  intrinsics: [1.0]\n", "camera_matrix is missing, found cam0"),
    (opencv("yml", FIVE, camera_matrix=np.eye(4)), "camera_matrix has 16 numbers, expected 9"),
    (opencv("yml", FIVE, camera_matrix=np.ones((3, 3))), "expected fx 0 cx, 0 fy cy, 0 0 1"),
    (opencv("yml", FIVE, camera_matrix=K / 1000 + np.diag([0, 0, 0.999])), "fx is 0.5267 pixels"),
    (opencv("yml", FIVE, camera_matrix=None, M1=K, M2=K), "has two cameras (M1 and the other)"),
    (opencv("yml", FIVE, image_width="wide"), 'is ["wide"], expected finite numbers'),
    (ROS.replace("526.7", ".nan"), "camera_matrix"),
    (ROS.replace("image_width: 640", "image_width: 640.5"), "expected whole pixels"),
    ("", "cannot be parsed"), ("just words", "cannot be parsed"),
    ("<?xml version='1.0'?><a>", "cannot be parsed"),
    ("{", "not JSON"), ("[1, 2]", "c.txt: "), ('{"depth": 3}', "c.txt: depth"),
    ('{"camera_matrix": "x"}', 'camera_matrix is "x", expected finite numbers'),
    ('{"K": [1e999, 0, 0, 0, 1, 0, 0, 0, 1]}', "expected finite numbers"),
    ("[" * 100_000, "c.txt: "), ("- a\n- b\n", "cannot be parsed"),
])
def test_what_is_wrong_is_named(tmp_path, capfd, text, found):
    (tmp_path / "c.txt").write_text(text)
    with pytest.raises(CalibrationError) as caught:
        read_calibration(tmp_path / "c.txt")
    assert str(caught.value).startswith(str(tmp_path / "c.txt"))
    assert found in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_damaged_files_are_errors_of_ours(tmp_path):
    rng = np.random.default_rng(5)
    for text in (ROS, opencv("yml"), opencv("xml"), PAIR.to_json()):
        for _ in range(60):
            data = bytearray(text.encode())
            for at in rng.integers(0, len(data), 4):
                data[at] = rng.integers(256)
            (tmp_path / "c").write_bytes(bytes(data))
            with suppress(CalibrationError):
                read_calibration(tmp_path / "c")


def test_a_binary_file_and_a_large_one_are_refused(tmp_path):
    (tmp_path / "c").write_bytes(b"\xff\xd8\xff\xe0 a picture")
    with pytest.raises(CalibrationError, match="not a text"):
        read_calibration(tmp_path / "c")
    (tmp_path / "c").write_bytes(b" " * (2**20 + 1))
    with pytest.raises(CalibrationError, match="Has more than 1048576 bytes"):
        read_calibration(tmp_path / "c")


@pytest.mark.parametrize(("t", "words"), [
    ((-0.023, 0, 0), "0.023 mm apart, expected 1 to 300: metres in place of millimetres?"),
    ((-2300, 0, 0), "2300 mm apart"), ((-23, 0, 0), None), ((0, 0, 0), None)])
def test_a_translation_that_no_sensor_has_is_doubted(t, words):
    doubts = doubts_of(PAIR.model_copy(update={"depth_to_color": DepthToColor(translation_mm=t)}))
    assert len(doubts) == bool(words)
    assert not words or words in doubts[0]
