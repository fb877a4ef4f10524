"""Faces of the mean face of the engine's model, with noise of a known kind and a known change."""

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from denseface.recon.face import DenseCloud, Face, PointCloud, Report
from denseface.recon.prior import FittedFace, basis
from denseface.recon.settings import Settings

STEP_MM, NOISE_MM = 1.5, 0.12
CHEEK = np.array([42.0, 22.0])
"""Of the person's left, in the model's frame: x and y, mm."""


def pose(yaw=0.0, pitch=0.0, roll=0.0, shift=(0.0, 0.0, 700.0)):
    return Rotation.from_euler("yxz", [yaw, pitch, roll], degrees=True).as_matrix(), np.array(shift)


def made_face(seed, at=None, *, height=0.0, width=20.0, noise=NOISE_MM):
    """A face in a pose, raised on the left cheek; its noise is alike over 4 mm."""
    rotation, shift = at if at is not None else pose()
    low = np.array([-130.0, -130.0]) + shift[:2]
    shape = (174, 174)
    model = FittedFace(rotation, shift, np.zeros(basis().modes.shape[2]), 0.0, 1.0)
    heights, known = model.heights(tuple(low), STEP_MM, shape)
    rows, columns = np.nonzero(cv2.erode(known.astype(np.uint8), np.ones((3, 3), np.uint8)))
    points = np.stack([low[0] + STEP_MM * columns, low[1] + STEP_MM * rows,
                       heights[rows, columns]], axis=1)
    field = cv2.GaussianBlur(np.random.default_rng(seed).standard_normal(shape), (0, 0),
                             4 / STEP_MM)
    own = (points - shift) @ rotation
    away = np.hypot(*(own[:, :2] - CHEEK).T)
    raised = height * np.exp(-0.5 * (away / (width / 2.355)) ** 2)
    points[:, 2] += noise * field[rows, columns] / field.std() - raised
    smooth = cv2.GaussianBlur(heights, (0, 0), 1.0)
    slope_y, slope_x = np.gradient(smooth, STEP_MM)
    normals = np.stack([slope_x[rows, columns], slope_y[rows, columns], -np.ones(len(rows))], 1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = points.astype(np.float32)
    report = Report(
        face_box=(1, 2, 5, 4), candidates=(), initial_points=len(points[::2]),
        dense_points=len(points), mean_spacing_mm=2 * STEP_MM, r0_mm=20, noise_mm=0.5,
        timings_ms={"total": 1.0}, settings=Settings(), calibration="made", skew_us=0, version="0")
    colors = np.full((len(points), 3), 180, np.uint8)
    return Face(
        PointCloud(points[::2].copy(), colors[::2].copy()),
        DenseCloud(points, colors, normals.astype(np.float32),
                   np.full(len(points), 0.4, np.float32),
                   np.stack([rows, columns], axis=1).astype(np.int32), shape, STEP_MM), report)
