"""Our own stages one by one, and what a call costs."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bench.cases import Case
from recon import Settings
from recon.densify import densify
from recon.detail import DetailedSurface, add_detail
from recon.neighbors import mean_spacing
from recon.rbf import Surface, fit_surface
from recon.registration import look_up, register
from recon.segment import segment_face
from recon.uncertainty import noise_share

__all__ = ["after_segmentation", "milliseconds", "surface_of"]


def milliseconds(call: Callable[[], object]) -> float:
    """Take the processor's time of a call: what else runs on the machine does not count."""
    start = time.process_time()
    call()
    return (time.process_time() - start) * 1e3


def surface_of(
    points: NDArray[np.float32], spacing: float, known: Settings
) -> Surface | DetailedSurface:
    """Fit (n, 3) points, mm, as `reconstruct` does."""
    fit = fit_surface(points, known.r0_factor * spacing, known.smoothing)
    if known.detail_factor is None:
        return fit
    return add_detail(fit, points, spacing, known.detail_factor * spacing)


def after_segmentation(case: Case, known: Settings) -> Callable[[], object]:
    """Give what `reconstruct` does with the seeds of a frame, ready to be called."""
    frame = case.frame
    registered = register(frame, known.depth_offset_mm)
    seeds = segment_face(registered, case.face.report.face_box, frame.calibration.color.fx)

    def call() -> object:
        spacing = mean_spacing(seeds.points, seeds.pixels, known.neighbors)
        return densify(seeds, surface_of(seeds.points, spacing, known), spacing, known.ratio,
                       noise_share(known), partial(look_up, frame, registered))

    return call
