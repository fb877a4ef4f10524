"""Our own stages one by one, OpenCV's detection beside them, and what a call costs."""

import time
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.cases import Case
from denseface.recon import Settings
from denseface.recon.fitting import plan_fit, surface_of
from denseface.recon.noise import measure_noise
from denseface.recon.propagation import densify
from denseface.recon.registration import register, sample_colors
from denseface.recon.segmentation import segment_face
from denseface.recon.surface import mean_spacing

__all__ = ["after_segmentation", "default_haar", "milliseconds"]


def milliseconds(call: Callable[[], object]) -> float:
    """Take the processor's time of a call: what else runs on the machine does not count."""
    start = time.process_time()
    call()
    return (time.process_time() - start) * 1e3


@cache
def default_haar() -> Callable[[NDArray[np.uint8]], object]:
    """Give OpenCV's frontal cascade with its defaults, the peer of whole frames: of (H, W) grey."""
    folder = Path(cv2.__file__).parent / "data"
    return cv2.CascadeClassifier(
        str(folder / "haarcascade_frontalface_default.xml")).detectMultiScale


def after_segmentation(case: Case, known: Settings) -> Callable[[], object]:
    """Give what `reconstruct` does with the seeds of a frame, ready to be called."""
    frame = case.frame
    registered = register(frame)
    seeds = segment_face(registered, case.face.report.face_box, frame.calibration.color.fx)

    sampler = partial(sample_colors, frame, registered)

    def call() -> object:
        spacing = mean_spacing(seeds.points, seeds.pixels, known.neighbors)
        plan = plan_fit(known, measure_noise(seeds.points, seeds.pixels, spacing), spacing)
        surface = surface_of(seeds.points, spacing, known, plan, sampler)
        return densify(seeds, surface, spacing, known.ratio, plan, sampler)

    return call
