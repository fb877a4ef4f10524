"""`denseface calibrate` on simulated boards: the true cameras and pose come back.

Boards are rendered through known cameras, with distortion, blur and noise.
"""

import json

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from denseface.capture import Calibration
from tests import boards
from tests.system.running import denseface
from tests.unit.capture.image_pair.files import write

CHARUCO = ["--charuco", "9x7", "--square", "28", "--marker", "21"]
CHECKERBOARD = ["--board", "9x6", "--square", "25"]
TRUE = boards.kinect()


def rendered(folder, board, count):
    """Write what both cameras see: infrared of 16 bits that is dark, and colour."""
    cameras = boards.sensor(TRUE)
    for number, pose in enumerate(boards.various_poses(count, seed=3)):
        infrared, color = cameras.views(board, pose, number)
        write(folder / f"ir/{number:02}.png", infrared.astype(np.uint16) * 4 + 100)
        write(folder / f"color/{number:02}.png", np.dstack([color] * 3))
    return ["--infrared", folder / "ir", "--color", folder / "color"]


@pytest.fixture(scope="module")
def checkerboard(tmp_path_factory):
    return rendered(tmp_path_factory.mktemp("board"), boards.checkerboard(9, 6, 25.0), 14)


def check_pose(found: Calibration) -> None:
    """Within 0.5 mm and 0.1 degrees, focal lengths within 0.2 %; reached are 0.1, 0.04, 0.1 %."""
    pose, true = found.depth_to_color, TRUE.depth_to_color
    assert np.linalg.norm(np.subtract(pose.translation_mm, true.translation_mm)) < 0.5
    turn = Rotation.from_matrix(np.array(pose.rotation) @ np.array(true.rotation).T)
    assert np.degrees(turn.magnitude()) < 0.1
    for camera, other in ((found.depth, TRUE.depth), (found.color, TRUE.color)):
        assert camera.fx == pytest.approx(other.fx, rel=0.002)
        assert camera.fy == pytest.approx(other.fy, rel=0.002)


def complaints(done):
    """Give what is on stderr, but for a line of progress on a slow machine."""
    return [line for line in done.stderr.splitlines() if not line.endswith(" ...")]


def test_a_checkerboard_gives_both_cameras_and_their_pose(tmp_path, checkerboard):
    done = denseface(
        "calibrate", *checkerboard, *CHECKERBOARD, "-o", tmp_path / "s.calibration.json",
        "--picture", tmp_path / "p.png", "--report", tmp_path / "r.json", "--sensor", "B00362",
        DENSEFACE_CALIBRATIONS=str(tmp_path / "sensors"))
    assert (done.returncode, complaints(done)) == (0, [])
    text = (tmp_path / "s.calibration.json").read_text()
    check_pose(Calibration.from_json(text))
    assert (tmp_path / "sensors/B00362.calibration.json").read_text() == text
    report = json.loads((tmp_path / "r.json").read_text())
    assert sum(view["used"] for view in report["views"]) >= 12
    assert report["rms_px"] < 0.1
    assert report["warnings"] == []
    assert "reprojection error: 0.0" in done.stdout
    assert cv2.imread(str(tmp_path / "p.png")).shape[1] > 1400


def test_a_charuco_board_does_too(tmp_path):
    board = boards.charuco(cv2.aruco.CharucoBoard(
        (9, 7), 28, 21, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)))
    done = denseface("calibrate", *rendered(tmp_path, board, 14), *CHARUCO,
                     "-o", tmp_path / "s.calibration.json")
    assert done.returncode == 0, done.stderr
    check_pose(Calibration.from_json((tmp_path / "s.calibration.json").read_text()))


def test_too_few_views_are_one_line_and_status_1(tmp_path, checkerboard):
    _, infrared, _, color = checkerboard
    few = ["--infrared", *sorted(infrared.iterdir())[:4], "--color", *sorted(color.iterdir())[:4]]
    done = denseface("calibrate", *few, *CHECKERBOARD, "-o", tmp_path / "s.calibration.json")
    assert (done.returncode, done.stdout) == (1, "")
    line, = complaints(done)
    assert "both cameras see the board in 4 of 4 pairs of images, expected 6 or more" in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("arguments", "message"), [
    ([*CHECKERBOARD], "-o FILE or --sensor SERIAL"),
    ([*CHECKERBOARD, "-o", "x.json"], "x.json: expected a name that ends in .calibration.json"),
    (["--board", "9", "--square", "25"], "such as 9x6, 3 to 60 each, found '9'"),
    ([*CHECKERBOARD[:2], "--square", "0.025"], "expected millimetres, 1 to 500, found '0.025'"),
    ([*CHARUCO[:4], "--marker", "30", "-o", "x.calibration.json"], "expected less than --square"),
    (["--charuco", "20x20", "--square", "28", "-o", "x.calibration.json"],
     "--charuco 20x20 has 200 markers, --dictionary 4X4_50 has 50"),
])
def test_wrong_usage_is_one_line_and_status_2(arguments, message):
    done = denseface("calibrate", "--infrared", "docs", "--color", "docs", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    line, = complaints(done)
    assert message in line
