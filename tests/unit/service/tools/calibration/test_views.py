"""Boards found in images, and images paired."""

import cv2
import numpy as np
import pytest

from denseface.capture.errors import UnreadableSourceError
from denseface.service.errors import UsageError
from denseface.service.tools.calibration import (
    Charuco,
    Checkerboard,
    look_for_board,
    paired_files,
)
from tests import boards
from tests.boards import sensor, various_poses
from tests.unit.capture.image_pair.files import write

CHECKERBOARD = Checkerboard(9, 6, 25.0)
CHARUCO = Charuco(9, 7, 28.0, 21.0, "4X4_50")


@pytest.fixture(scope="module")
def seen():
    """A checkerboard and a ChArUco board as both cameras see them, and where they are."""
    cameras, pose = sensor(boards.kinect()), various_poses(5)[1]
    return pose, {
        CHECKERBOARD: cameras.views(boards.checkerboard(9, 6, 25.0), pose, 1),
        CHARUCO: cameras.views(boards.charuco(CHARUCO._boards[0]), pose, 2)}


def true_corners(board, pose, camera, to_camera=None):
    points = board.points - np.append(board.points.max(axis=0)[:2] / 2, 0)
    points = points @ pose.rotation.T + pose.center_mm
    return camera.project(to_camera.apply(points) if to_camera else points)


@pytest.mark.parametrize("board", [CHECKERBOARD, CHARUCO], ids=["checkerboard", "charuco"])
def test_corners_are_found_to_a_tenth_of_a_pixel(seen, board):
    pose, images = seen
    calibration = boards.kinect()
    for image, camera, to_camera in zip(
            images[board], (calibration.depth, calibration.color),
            (None, calibration.depth_to_color), strict=True):
        corners = board.find(image)
        expected = true_corners(board, pose, camera, to_camera)[corners.ids]
        off = np.linalg.norm(corners.pixels - expected, axis=1)
        if off.mean() > 1:  # a checkerboard is numbered from either end
            off = np.linalg.norm(corners.pixels[::-1] - expected, axis=1)
        assert np.sqrt((off**2).mean()) < 0.12
        assert len(corners.ids) > 0.8 * len(board.points)


def test_a_charuco_board_is_found_where_half_of_it_is_hidden(seen):
    pose, images = seen
    hidden = images[CHARUCO][0].copy()
    expected = true_corners(CHARUCO, pose, boards.kinect().depth)
    middle = int(expected[:, 0].mean())
    hidden[:, middle:] = 90
    corners = CHARUCO.find(hidden)
    assert 8 <= len(corners.ids) < 40
    np.testing.assert_allclose(corners.pixels, expected[corners.ids], atol=0.5)


def test_no_board_is_none(seen):
    _, images = seen
    room = np.full((480, 640), 120, np.uint8)
    assert CHECKERBOARD.find(room) is None
    assert CHARUCO.find(room) is None
    assert Checkerboard(7, 5, 25.0).find(images[CHARUCO][0]) is None


def test_dark_infrared_of_16_bits_and_colour_are_read_and_numbered_alike(tmp_path, seen):
    _, images = seen
    infrared, color = images[CHECKERBOARD]
    dark = infrared.astype(np.uint16) * 3 + 40
    dark[5, 5] = 65535  # a reflex
    turned = np.dstack([color] * 3)
    files = [(write(tmp_path / "i.png", dark), write(tmp_path / "c.png", turned))]
    views, depth_size, color_size = look_for_board(files, CHECKERBOARD, 2**20)
    assert depth_size == color_size == (640, 480)
    view, = views
    apart = view.depth.pixels - view.color.pixels
    assert np.abs(apart - apart.mean(axis=0)).max() < 40


def test_images_of_two_sizes_and_what_is_no_image_are_named(tmp_path):
    grey = np.full((48, 64), 90, np.uint8)
    a, b = write(tmp_path / "a.png", grey), write(tmp_path / "b.png", grey[:40])
    with pytest.raises(UsageError, match=r"b\.png: is 64x40, .*a\.png is 64x48: expected images"):
        look_for_board([(a, a), (b, a)], CHECKERBOARD, 2**20)
    (tmp_path / "c.png").write_text("no image")
    with pytest.raises(UnreadableSourceError, match=r"c\.png: not an image"):
        look_for_board([(a, tmp_path / "c.png")], CHECKERBOARD, 2**20)


def test_folders_are_paired_by_names_or_numbers_and_files_by_their_order(tmp_path):
    for name in ("ir/ir_01.png", "ir/ir_02.png", "ir/notes.txt", "rgb/rgb-2.jpg", "rgb/rgb-1.jpg",
                 "same/ir_02.png", "none/readme.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")

    def names(first, second):
        return [(a.name, b.name) for a, b in paired_files(first, second)]

    ir, rgb = [tmp_path / "ir"], [tmp_path / "rgb"]
    assert names(ir, rgb) == [("ir_01.png", "rgb-1.jpg"), ("ir_02.png", "rgb-2.jpg")]
    assert names(ir, [tmp_path / "same"]) == [("ir_02.png", "ir_02.png")]
    files = [tmp_path / "ir/ir_02.png", tmp_path / "ir/ir_01.png"]
    assert names(files, [tmp_path / "rgb/rgb-1.jpg"] * 2)[0] == ("ir_02.png", "rgb-1.jpg")
    with pytest.raises(UsageError, match="2 infrared images and 1 colour images cannot be paired"):
        paired_files(files, [tmp_path / "rgb/rgb-1.jpg"])
    with pytest.raises(UsageError, match="none: no images"):
        paired_files(ir, [tmp_path / "none"])


def test_older_charuco_boards_are_found():
    old = Charuco(8, 6, 28.0, 21.0, "4X4_50")
    pose = various_poses(5)[1]
    image, _ = sensor(boards.kinect()).views(boards.charuco(old._boards[1]), pose, 3)
    assert len(old.find(image).ids) > 0.8 * len(old.points)
    assert cv2.aruco.CharucoDetector(old._boards[0]).detectBoard(image)[1] is None
