"""A small picture of a face, or of a frame without one: some 2 KB, in a hundredth of its time."""

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.frame import RgbdFrame
from denseface.recon.face import Face
from denseface.service.tools.batch.row import MAX_THUMBNAIL_BYTES

__all__ = ["SIDE", "thumbnail"]

SIDE = 112
"""The longer side of a picture, pixels."""
_PAPER = 128
"""Grey where there is nothing: seen on a light page and on a dark one."""
_DARKEST = 40
"""Grey of the farthest depth."""
_QUALITIES = 80, 60, 35, 10
"""Of the JPEG, the first that is small enough: 80 is, but of pure noise."""


def thumbnail(shown: Face | RgbdFrame) -> bytes:
    """Draw a dense face as its grid is, or a frame's colour image, or its depth, as a small JPEG.

    Returns
    -------
    At most `MAX_THUMBNAIL_BYTES`; the longer side has `SIDE` pixels
    """
    image = _face(shown) if isinstance(shown, Face) else _frame(shown)
    scale = SIDE / max(image.shape[:2])
    size = tuple(max(1, round(side * scale)) for side in image.shape[1::-1])
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    for quality in _QUALITIES:
        data = cv2.imencode(".jpg", small[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        if len(data) <= MAX_THUMBNAIL_BYTES:
            break
    return data.tobytes()


def _face(face: Face) -> NDArray[np.uint8]:
    dense = face.dense
    # Column by column: numpy takes ten times as long along the short axis of (n, 2).
    down, across = np.ascontiguousarray(dense.cells.T)
    down, across = down - down[0], across - across.min()  # sorted by row
    rows, columns = down[-1] + 1, across.max() + 1
    # Twice as fine as the picture is enough for its averages, and has a quarter of the points.
    step = max(1, max(rows, columns) // (2 * SIDE))
    kept = np.flatnonzero((down % step == 0) & (across % step == 0))
    rows, columns = -(-rows // step), -(-columns // step)
    image = np.full((rows * columns, 3), _PAPER, np.uint8)
    image[down[kept] // step * columns + across[kept] // step] = dense.colors[kept]
    return image.reshape(rows, columns, 3)


def _frame(frame: RgbdFrame) -> NDArray[np.uint8]:
    if frame.color is not None:
        return frame.color
    # What has no reading would be mixed in by the average: every so many-th pixel is as good.
    step = max(1, max(frame.depth.shape) // SIDE)
    depth = frame.depth[::step, ::step].astype(np.float32)
    there = depth > 0
    near, far = np.percentile(depth[there], (2, 98)) if there.any() else (0.0, 1.0)
    share = np.clip((far - depth) / max(far - near, 1), 0, 1)
    grey = np.where(there, _DARKEST + (255 - _DARKEST) * share, 0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)
