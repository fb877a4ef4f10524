"""Small pictures of faces, and of frames without one."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from denseface.recon.face import DenseCloud
from denseface.service.tools.batch.row import MAX_THUMBNAIL_BYTES, Row
from denseface.service.tools.batch.summary.thumbnail import SIDE, thumbnail
from tests.unit.frames import calibration, camera, frame
from tests.unit.service.faces import small_face, small_frame


def decoded(data):
    assert 0 < len(data) <= MAX_THUMBNAIL_BYTES
    Row(source="a", frame=0, state="face", thumbnail=data)
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(int)


@pytest.mark.parametrize(("rows", "columns"), [(12, 9), (60, 400), (700, 500)])
def test_a_face_is_drawn_as_its_grid_lies(rows, columns):
    face = small_face(rows, columns)
    dense, cells = face.dense, face.dense.cells
    kept = (cells[:, 0] >= rows / 3) | (cells[:, 1] >= columns / 3)
    colors = np.where(cells[:, :1] < rows / 2, (200, 20, 20), (20, 20, 200)).astype(np.uint8)
    cut = DenseCloud(
        dense.points[kept], colors[kept], dense.normals[kept], dense.sigma[kept],
        cells[kept] + np.int32(7), (rows + 20, columns + 20), dense.grid_step_mm)
    image = decoded(thumbnail(replace(face, dense=cut)))
    height, width = image.shape[:2]
    assert max(height, width) == SIDE
    assert width / height == pytest.approx(columns / rows, abs=0.05, rel=0.05)
    assert np.abs(image[height // 5, -width // 3] - (200, 20, 20)).max() < 40
    assert np.abs(image[-height // 5, width // 2] - (20, 20, 200)).max() < 40
    assert np.abs(image[height // 8, width // 8] - 128).max() < 20  # nothing is there


def test_a_frame_is_its_colour_image_and_without_one_its_depth_near_is_light():
    taken = small_frame()
    assert decoded(thumbnail(taken)).shape[:2] == (round(SIDE * 7 / 10), SIDE)
    depth = np.zeros((48, 64), np.uint16)
    depth[:, :32], depth[:, 32:60] = 700, 2000
    own = calibration(depth=camera(64, 48, 80.0), color=camera(64, 48, 80.0))
    dark = frame(depth, None, own)
    image = decoded(thumbnail(dark))
    near, far, none = image[40, 20].mean(), image[40, 80].mean(), image[40, -1].mean()
    assert near > 230
    assert 20 < far < 80
    assert none < 20
    assert decoded(thumbnail(replace(dark, depth=np.zeros_like(depth)))).max() < 10


def test_the_noisiest_picture_fits():
    noise = np.random.default_rng(0).integers(0, 256, (112, 112, 3), np.uint8)
    own = calibration(depth=camera(8, 6, 10.0), color=camera(112, 112, 100.0))
    decoded(thumbnail(frame(np.full((6, 8), 700, np.uint16), noise, own)))
