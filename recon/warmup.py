"""What the first frame would otherwise wait for: compiled loops, cascades, memory."""

from contextlib import suppress
from functools import cache, partial

import numpy as np

from capture.frame import Calibration, CameraModel, RgbdFrame
from recon._detect_kernels import depths_in_box, middle_depths
from recon._relief import bulge_mm
from recon.densify import densify
from recon.detail import add_detail
from recon.detect import detect_face
from recon.errors import NoFaceError
from recon.heap import keep_freed_memory
from recon.neighbors import mean_spacing
from recon.packing import pack
from recon.rbf import fit_surface
from recon.registration import look_up, register
from recon.segment import segment_face
from recon.settings import Settings

__all__ = ["warm"]

_WIDTH, _HEIGHT = 160, 120
_FOCAL_PX = 150.0
_BOX = (58, 38, 44, 44)
_NEAREST_MM = 700.0
_HOLE = np.s_[66:76, 82:92]


@cache
def warm() -> None:
    """Go once through every stage, with a ball for a face, and pack it; does nothing when repeated.

    The ball has a hole, which is filled.

    From then on the process keeps memory that a frame frees for the next: `recon.heap`.
    """
    keep_freed_memory()
    settings = Settings()
    frame = _ball()
    registered = register(frame)
    with suppress(NoFaceError):  # not even OpenCV sees one
        detect_face(frame.color, registered, _FOCAL_PX)
    left, top, width, height = map(float, _BOX)
    depths = depths_in_box(registered.pixels, registered.color_depth, registered.visible,
                           left, top, width, height)
    middle_depths(depths, 0.5)
    bulge_mm(depths, _NEAREST_MM)
    seeds = segment_face(registered, _BOX, _FOCAL_PX)
    spacing = mean_spacing(seeds.points, seeds.pixels, settings.neighbors)
    fit = fit_surface(seeds.points, settings.r0_factor * spacing, settings.smoothing)
    looked_up = partial(look_up, frame, registered)
    surface = add_detail(fit, seeds.points, spacing, spacing, symmetry=True, look_up=looked_up)
    pack(densify(seeds, surface, spacing, settings.ratio, 1.0, looked_up))


def _ball() -> RgbdFrame:
    camera = CameraModel(width=_WIDTH, height=_HEIGHT, fx=_FOCAL_PX, fy=_FOCAL_PX,
                         cx=(_WIDTH - 1) / 2, cy=(_HEIGHT - 1) / 2)
    v, u = np.mgrid[:_HEIGHT, :_WIDTH]
    lower = ((u - camera.cx) ** 2 + (v - camera.cy) ** 2) / 20
    depth = np.where(lower < 60, _NEAREST_MM + lower, 1500).astype(np.uint16)
    depth[_HOLE] = 0
    return RgbdFrame(depth, np.full((_HEIGHT, _WIDTH, 3), 128, np.uint8), 0, 0,
                     Calibration(depth=camera, color=camera), registered=True)
