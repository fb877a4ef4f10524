"""Cameras and pose from corners that were projected, with noise, through known cameras."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from denseface.capture import Calibration, CameraModel, DepthToColor
from denseface.service.errors import CalibrationFailedError
from denseface.service.tools.calibration import (
    BoardView,
    CalibrationReport,
    Checkerboard,
    picture,
    solve,
)
from denseface.service.tools.calibration._boards import Corners
from tests.boards import Poses, kinect, various_poses

BOARD = Checkerboard(9, 6, 25.0)
IDS = np.arange(54)
NOISE_PX = 0.03
"""Of a corner's position along an axis, as it is on rendered boards."""
CENTER = np.array([100.0, 62.5, 0.0])


def view_of(calibration, pose, seed, noise=NOISE_PX, name="v"):
    """Give the corners as both cameras would find them."""
    rng = np.random.default_rng(seed)
    points = (BOARD.points - CENTER) @ pose.rotation.T + pose.center_mm
    found = [camera.project(seen) + rng.normal(0, noise, (54, 2)) for camera, seen in (
        (calibration.depth, points), (calibration.color, calibration.depth_to_color.apply(points)))]
    return BoardView(name, *(Corners(IDS, pixels) for pixels in found))


def views_of(calibration, poses, noise=NOISE_PX, seed=0):
    return [view_of(calibration, pose, (seed, number), noise, f"{number}.png")
            for number, pose in enumerate(poses)]


def solved(views, calibration):
    sizes = [(camera.width, camera.height) for camera in (calibration.depth, calibration.color)]
    return solve(views, BOARD, *sizes)


def errors(found: Calibration, true: Calibration) -> tuple[float, float]:
    """Give how far the pose is off, mm and degrees."""
    turn = np.array(found.depth_to_color.rotation) @ np.array(true.depth_to_color.rotation).T
    return (float(np.linalg.norm(np.subtract(found.depth_to_color.translation_mm,
                                             true.depth_to_color.translation_mm))),
            float(np.degrees(Rotation.from_matrix(turn).magnitude())))


AZURE = Calibration(
    depth=CameraModel(width=640, height=576, fx=504, fy=504, cx=324, cy=330,
                      distortion=(-0.02, 0.01, 0, 0, 0)),
    color=CameraModel(width=1280, height=720, fx=604, fy=603, cx=638, cy=366,
                      distortion=(0.05, -0.03, 0.0004, -0.0002, 0)),
    depth_to_color=DepthToColor(rotation=tuple(map(tuple, Rotation.from_euler(
        "x", -6, degrees=True).as_matrix().tolist())), translation_mm=(-32, -2, 4)))
PINHOLE = Calibration(
    depth=CameraModel(width=640, height=480, fx=575.8, fy=575.8, cx=319.5, cy=239.5),
    color=CameraModel(width=640, height=480, fx=525, fy=525, cx=319.5, cy=239.5),
    depth_to_color=DepthToColor(translation_mm=(-23, 0, 0)))


@pytest.mark.parametrize("true", [kinect(), AZURE, PINHOLE], ids=["kinect", "azure", "pinhole"])
def test_cameras_and_pose_are_found(true):
    solution = solved(views_of(true, various_poses(16)), true)
    found = solution.calibration
    mm, degrees = errors(found, true)
    assert mm < 0.2
    assert degrees < 0.06
    for camera, other in ((found.depth, true.depth), (found.color, true.color)):
        assert camera.fx == pytest.approx(other.fx, rel=0.003)
        assert camera.cx == pytest.approx(other.cx, abs=2.0)
        assert (camera.width, camera.height) == (other.width, other.height)
    assert solution.rms_px == pytest.approx(NOISE_PX * 2**0.5, rel=0.1)
    assert all(view.why_not == "" and view.rms_px < 0.12 for view in solution.views)


def test_what_it_is_worth_is_said():
    """Over many boards the errors are those that the standard deviations say, near enough."""
    true, ratios = kinect(), []
    for seed in range(5):
        solution = solved(views_of(true, various_poses(10, seed), 0.15, seed), true)
        mm, degrees = errors(solution.calibration, true)
        ratios += [mm / solution.accuracy.translation_mm, degrees / solution.accuracy.rotation_deg]
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 2


def test_a_pinhole_gets_no_distortion_out_of_noise():
    found = solved(views_of(PINHOLE, various_poses(14)), PINHOLE).calibration
    pixels = np.stack(np.meshgrid([0, 320, 639], [0, 240, 479]), -1).astype(float)
    for camera in (found.depth, found.color):
        straight = camera.model_copy(update={"distortion": (0.0,) * 5})
        off = camera.project(straight.back_project(pixels, 1.0)) - pixels
        assert np.abs(off).max() < 1.5


def test_a_view_that_does_not_fit_is_left_out_and_named():
    true = kinect()
    views = views_of(true, various_poses(14))
    moved = view_of(true, various_poses(14)[9], 9)
    shifted = moved.color.pixels + np.array([3.0, -2.0])  # the board moved between both images
    views[5] = BoardView("moved.png", moved.depth, Corners(IDS, shifted))
    bent = views[11].depth.pixels + np.random.default_rng(1).normal(0, 2, (54, 2))
    views[11] = BoardView("bent.png", Corners(IDS, bent), views[11].color)
    views[2] = BoardView("dark.png", None, views[2].color)
    solution = solved(views, true)
    left_out = {view.name: view.why_not for view in solution.views if view.rms_px is None}
    assert left_out.keys() == {"moved.png", "bent.png", "dark.png"}
    assert left_out["dark.png"] == "no board found in the infrared image"
    assert "does not fit the others (off by" in left_out["moved.png"]
    mm, degrees = errors(solution.calibration, true)
    assert (mm < 0.5, degrees < 0.1) == (True, True)


def test_too_few_views_are_refused_with_what_was_wrong():
    views = [view._replace(color=None) if number > 3 else view
             for number, view in enumerate(views_of(kinect(), various_poses(10)))]
    with pytest.raises(CalibrationFailedError, match=r"in 4 of 10 pairs of images, expected 6 or "
                       r"more \(ten to twenty\): 6 x no board found in the colour image"):
        solved(views, kinect())


def test_views_that_are_alike_are_refused():
    pose = various_poses(3)[0]
    near = [Poses(pose.rotation, pose.center_mm + np.array([number, 0, 0])) for number in range(12)]
    with pytest.raises(CalibrationFailedError,
                       match="the 12 views are of 1 kinds, expected 5 that differ: hold the board"):
        solved(views_of(kinect(), near), kinect())


def test_a_board_that_is_never_tilted_is_refused():
    flat = [Poses(np.eye(3), np.array([x, y, z])) for z in (500.0, 700.0)
            for x in (-80.0, 0.0, 80.0) for y in (-40.0, 40.0)]
    with pytest.raises(CalibrationFailedError, match=r"tilted by \d+ degrees at most, expected 20"):
        solved(views_of(kinect(), flat), kinect())


def test_a_mirrored_image_is_refused():
    true = kinect()
    mirrored = [view._replace(color=Corners(IDS, (view.color.pixels * (-1, 1) + (639, 0)
                                                  ).reshape(6, 9, 2)[:, ::-1].reshape(-1, 2)))
                for view in views_of(true, various_poses(12))]
    with pytest.raises(CalibrationFailedError, match="is neither image mirrored"):
        solved(mirrored, true)


def test_the_wrong_number_of_corners_or_size_is_refused_or_doubted():
    rng = np.random.default_rng(2)
    views = [BoardView(str(number), *(Corners(IDS, rng.uniform((0, 0), (640, 480), (54, 2)))
                                      for _ in range(2))) for number in range(8)]
    with pytest.raises(CalibrationFailedError):
        solved(views, kinect())


def test_a_part_of_a_board_is_enough():
    true = kinect()
    views = []
    for number, view in enumerate(views_of(true, various_poses(16))):
        of_depth, of_color = (np.sort(np.random.default_rng(number + 100 * at).permutation(54)[:35])
                              for at in (0, 1))
        views.append(BoardView(view.name, Corners(of_depth, view.depth.pixels[of_depth]),
                               Corners(of_color, view.color.pixels[of_color])))
    mm, degrees = errors(solved(views, true).calibration, true)
    assert mm < 0.5
    assert degrees < 0.1


def test_the_report_and_the_picture_show_each_view():
    true = kinect()
    views = views_of(true, various_poses(10))
    views[3] = BoardView("dark.png", None, views[3].color)
    solution = solved(views, true)
    report = CalibrationReport.of(solution, ("a doubt",))
    assert [view.used for view in report.views] == [number != 3 for number in range(10)]
    assert report.warnings == ("a doubt",)
    assert CalibrationReport.model_validate_json(report.model_dump_json()) == report
    image = cv2.imdecode(np.frombuffer(picture(solution), np.uint8), cv2.IMREAD_COLOR)
    assert image.shape[1] > 1400
    green = (image[..., 1] > 150) & (image[..., 2] < 120)
    assert green.sum() > 3000
