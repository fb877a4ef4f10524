"""What the virtual sensor shows: the frame file that its driver plays (little-endian).

====== ==========================================================================================
bytes  what
====== ==========================================================================================
8      ``VSENSOR1``
4 x 4  uint32 version (1), number of frames, width, height
8      uint64 zero plane distance (ZPD), mm
8 x 3  float64 zero plane pixel size (ZPPS), mm; emitter to depth camera (LDDIS), cm;
       depth to colour camera (DCRCDIS), cm
4 x 4  float32 field of view, radians: depth horizontal, vertical, colour horizontal, vertical
rest   for each frame the depth image, uint16 mm, then the colour image, uint8 RGB
====== ==========================================================================================
"""

import math
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["write_clip"]

_HEADER = struct.Struct("<8s4IQ3d4f")


def write_clip(
    path: Path,
    frames: Sequence[tuple[NDArray[np.uint16], NDArray[np.uint8]]],
    *,
    zpd_mm: int = 120,
    zpps_mm: float = 0.1042,
    lddis_cm: float = 7.5,
    dcrcdis_cm: float = 2.3,
    depth_fov: tuple[float, float] = (1.0144686, 0.7898094),
    color_fov: tuple[float, float] = (2 * math.atan(320 / 525), 2 * math.atan(240 / 525)),
) -> None:
    """Write the frame file of the virtual sensor.

    Parameters
    ----------
    frames : (depth (H, W) uint16 mm, color (H, W, 3) uint8 RGB) pairs, all of one size
    zpd_mm, zpps_mm, lddis_cm, dcrcdis_cm : what the depth stream says of itself
    depth_fov, color_fov : horizontal and vertical field of view, radians
    """
    height, width = frames[0][0].shape
    with path.open("wb") as file:
        file.write(_HEADER.pack(b"VSENSOR1", 1, len(frames), width, height, zpd_mm, zpps_mm,
                                lddis_cm, dcrcdis_cm, *depth_fov, *color_fov))
        for depth, color in frames:
            if depth.shape != (height, width) or color.shape != (height, width, 3):
                raise ValueError(f"frames must all be {width}x{height}, got depth {depth.shape} "
                                 f"and color {color.shape}")
            file.write(np.ascontiguousarray(depth, "<u2").tobytes())
            file.write(np.ascontiguousarray(color, np.uint8).tobytes())
