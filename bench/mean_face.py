"""Make the mean face that results are judged by: `recon/judgement/mean_face.npz`."""

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from bench.heads import CHOOSING, at_hand
from tests.simulator import load_head

__all__: list[str] = []

_AXIS_MM = 90.0
"""How far behind the bridge of the nose the axis stands, on a face of that size."""
_HALF_HEIGHT_MM = 90.0
"""From the middle of the face to its chin; heads are scaled to it."""
_ANGLES_DEG, _HEIGHTS_MM, _STEP = (-110.0, 110.0), (-125.0, 115.0), 2.5
_OUTSIDE_MM = 300.0
_LIPS = 5
"""Samples, along the height, over which what lies between open lips is closed."""
_BLUR = 1.2
"""Standard deviation of the Gaussian that smooths it, samples."""
_LAMP, _INTENSITY, _AMBIENT = (0.0, -0.4, -0.9), 0.75, 0.35
"""The light of the simulator's rooms, from the middle."""
_DARK = 8.0
"""Grey levels that are added before the logarithm, as where colours are judged."""

Floats = NDArray[np.float32]


def _cast(name: str) -> tuple[Floats, Floats]:
    """Cast rays at a head from all around toward its axis.

    Gives the radius, mm, and the logarithm of the brightness there, both (heights, angles).
    """
    head = load_head(name)
    scene = o3d.t.geometry.RaycastingScene()
    scale = _HALF_HEIGHT_MM / head.landmarks.chin[0]
    scene.add_triangles(
        o3d.core.Tensor(np.ascontiguousarray(head.vertices * scale, np.float32)),
        o3d.core.Tensor(np.ascontiguousarray(head.faces, np.uint32)))
    angles, heights = (np.arange(low, high + 0.1, _STEP)
                       for low, high in (_ANGLES_DEG, _HEIGHTS_MM))
    angle, height = np.meshgrid(np.radians(angles), heights)
    outward = np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=-1)
    start = _OUTSIDE_MM * outward + np.stack([0 * angle, height, 0 * angle + _AXIS_MM], axis=-1)
    rays = np.concatenate([start, -outward], axis=-1).astype(np.float32)
    found = scene.cast_rays(o3d.core.Tensor(rays))
    away, normals = found["t_hit"].numpy(), found["primitive_normals"].numpy()
    seen = np.isfinite(away)
    triangles = np.where(seen, found["primitive_ids"].numpy(), 0).ravel().astype(np.int64)
    u, v = found["primitive_uvs"].numpy().reshape(-1, 2).T
    albedo = head.colors_at(triangles, np.stack([1 - u - v, u, v], axis=1)).mean(axis=1)
    normals *= np.sign((normals * outward).sum(axis=-1, keepdims=True))
    light = _AMBIENT + _INTENSITY * np.maximum(normals @ np.array(_LAMP), 0)
    # A picture's values are roots of light, about.
    brightness = np.log(albedo.reshape(light.shape) * light**(1 / 2.2) + _DARK)
    return (np.asarray(_OUTSIDE_MM - np.where(seen, away, np.nan), np.float32),
            np.asarray(np.where(seen, brightness, np.nan), np.float32))


def main() -> int:
    """Write the file."""
    parser = argparse.ArgumentParser(prog="python -m bench.mean_face", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("recon/judgement/mean_face.npz"))
    args = parser.parse_args()
    cast = [_cast(name) for name in at_hand(CHOOSING)]
    mean, brightness = (np.nanmean(one, axis=0) for one in zip(*cast, strict=True))
    mean, brightness = ((one + one[:, ::-1]) / 2 for one in (mean, brightness))
    mean = cv2.morphologyEx(mean, cv2.MORPH_CLOSE, np.ones((_LIPS, 1), np.uint8))
    mean = cv2.GaussianBlur(mean, (0, 0), _BLUR)
    brightness = cv2.GaussianBlur(brightness, (0, 0), _BLUR)
    np.savez_compressed(
        args.out, radius=mean.astype(np.float16), brightness=brightness.astype(np.float16),
        axes=np.array([_ANGLES_DEG[0], _STEP, _HEIGHTS_MM[0], _STEP, _AXIS_MM]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
