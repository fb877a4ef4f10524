"""What the first frame would otherwise wait for: compiled loops, cascades, memory."""

from contextlib import suppress
from functools import cache, partial

import numpy as np

from denseface.capture.calibration import Calibration, CameraModel
from denseface.capture.frame import RgbdFrame
from denseface.recon.detection import detect_by_depth, detect_face, judge_box
from denseface.recon.errors import NoFaceError
from denseface.recon.fitting import plan_fit, surface_of
from denseface.recon.judgement import color_likeness, judge_shape, score_quickly
from denseface.recon.noise import measure_noise
from denseface.recon.numerics.compilation.progress import compiling
from denseface.recon.numerics.malloc import keep_freed_memory
from denseface.recon.openings import openings
from denseface.recon.prior import Heights, fit_face, mean_face
from denseface.recon.propagation import densify
from denseface.recon.registration import own_readings, pooled, register, sample_colors
from denseface.recon.segmentation import segment_face
from denseface.recon.settings import Settings
from denseface.recon.surface import mean_spacing

__all__ = ["warm"]

_WIDTH, _HEIGHT, _FOCAL_PX = 160, 120, 150.0
"""The camera, pixels."""
_NEAREST_MM = 700.0
"""Depth of the ball's front."""
_BOX = (58, 38, 44, 44)
"""x, y, width, height of the ball in the image, pixels."""
_HOLE = np.s_[66:76, 82:92]
"""Its hole, which is filled: rows, columns."""


@cache
def warm() -> None:
    """Run every stage once, with a ball for a face; when repeated, does nothing.

    From then on the process keeps memory that a frame frees for the next: `recon.numerics.malloc`.
    """
    keep_freed_memory()
    with compiling.session():
        _run_every_stage()


def _run_every_stage() -> None:
    settings = Settings()
    frame = _ball()
    pooled(frame, (slice(0, _HEIGHT), slice(0, _WIDTH)), 2)
    registered = register(frame)
    with suppress(NoFaceError):  # not even OpenCV sees one
        detect_face(frame.rgb, registered, _FOCAL_PX, score=score_quickly)
    with suppress(NoFaceError):
        detect_by_depth(frame, registered, score=score_quickly)
    judge_box(_BOX, registered, _FOCAL_PX)
    seeds = segment_face(registered, _BOX, _FOCAL_PX)
    own_readings(frame, seeds.pixels, np.ascontiguousarray(seeds.points[:, 2]), 1)
    spacing = mean_spacing(seeds.points, seeds.pixels, settings.neighbors)
    sampler = partial(sample_colors, frame, registered)
    plan = plan_fit(settings, measure_noise(seeds.points, seeds.pixels, spacing), spacing)
    surface = surface_of(seeds.points, spacing, settings, plan, sampler)
    placement = judge_shape(surface).placement
    if placement is not None:
        color_likeness(placement, seeds.points, seeds.colors)
    openings(densify(seeds, surface, spacing, settings.ratio, plan, sampler))
    heights, known = mean_face(_NEAREST_MM).heights((-90.0, -90.0), 4.0, (45, 45))
    fit_face(Heights(heights, known.astype(np.float32), (-90.0, -90.0), 4.0))


def _ball() -> RgbdFrame:
    camera = CameraModel(width=_WIDTH, height=_HEIGHT, fx=_FOCAL_PX, fy=_FOCAL_PX,
                         cx=(_WIDTH - 1) / 2, cy=(_HEIGHT - 1) / 2)
    v, u = np.mgrid[:_HEIGHT, :_WIDTH]
    lower = ((u - camera.cx) ** 2 + (v - camera.cy) ** 2) / 20
    depth = np.where(lower < 60, _NEAREST_MM + lower, 1500).astype(np.uint16)
    depth[_HOLE] = 0
    return RgbdFrame(depth, np.full((_HEIGHT, _WIDTH, 3), 128, np.uint8), 0, 0,
                     Calibration(depth=camera, color=camera), registered=True)
