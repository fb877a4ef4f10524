"""A small made-up face and frame."""

import cv2
import numpy as np

from denseface.capture.frame import RgbdFrame
from denseface.recon.face import DenseCloud, Face, PointCloud, Report
from denseface.recon.settings import Settings
from tests.unit.frames import calibration, camera, frame


def small_frame(seed: int = 0) -> RgbdFrame:
    rng = np.random.default_rng(seed)
    calib = calibration(depth=camera(8, 6, 10.0), color=camera(10, 7, 10.0))
    return frame(rng.integers(0, 2000, (6, 8), np.uint16),
                 rng.integers(0, 256, (7, 10, 3), np.uint8), calib)


def jpeg(width: int, height: int, seed: int = 0, quality: int = 85) -> bytes:
    """A picture of noise as a JPEG."""
    image = np.random.default_rng(seed).integers(0, 256, (height, width, 3), np.uint8)
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def small_face(rows: int = 12, columns: int = 9, step: float = 2.0) -> Face:
    """A dome over a grid with its corner cells missing, as a face of a `small_frame`."""
    v, u = np.mgrid[:rows, :columns]
    keep = (u + v > 1) & (u + v < rows + columns - 3)
    v, u = v[keep], u[keep]
    x, y = (u - columns / 2) * step, (v - rows / 2) * step
    z = 700 + (x * x + y * y) / 80
    points = np.stack([x, y, z], axis=1).astype(np.float32)
    normals = np.stack([x / 40, y / 40, -np.ones_like(x)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colors = np.stack([u * 20, v * 15, np.full_like(u, 90)], axis=1).astype(np.uint8)
    report = Report(
        capture_id="", face_box=(1, 2, 5, 4), candidates=(), initial_points=len(points[::4]),
        dense_points=len(points), mean_spacing_mm=2 * step, r0_mm=28 * step,
        noise_mm=0.5, timings_ms={"total": 1.0}, settings=Settings(), calibration="unspecified",
        skew_us=-1000, version="0")
    return Face(
        PointCloud(points[::4].copy(), colors[::4].copy()),
        DenseCloud(points, colors, normals.astype(np.float32),
                   (0.5 + 0.1 * np.hypot(x, y)).astype(np.float32),
                   np.stack([v, u], axis=1).astype(np.int32), (rows, columns), step),
        report)
