"""Image files to be read, written where a test wants them."""

import os
from pathlib import Path

import cv2
import numpy as np

os.environ.setdefault("OPENCV_IO_ENABLE_OPENEXR", "1")

DEPTH = np.zeros((48, 64), np.uint16)
DEPTH[4:-4, 4:-4] = 700 + np.arange(56) * 7
"""mm, like a face at 0.7 to 1.1 m."""
COLOR = np.dstack([np.full((48, 64), 10), np.tile(np.arange(64) * 3, (48, 1)),
                   np.full((48, 64), 200)]).astype(np.uint8)
"""RGB: little red, much blue."""


def write(path: Path, image: np.ndarray) -> Path:
    """Write an image, colours given as RGB, in the format of the path's ending."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".npy":
        np.save(path, image, allow_pickle=False)
        return path
    if image.ndim == 3 and image.shape[2] in (3, 4):
        image = image[..., [2, 1, 0, 3][:image.shape[2]]]
    lossless = {".webp": [cv2.IMWRITE_WEBP_QUALITY, 101]}.get(path.suffix, [])
    ok, data = cv2.imencode(path.suffix, image, lossless)
    assert ok
    path.write_bytes(data.tobytes())
    return path
