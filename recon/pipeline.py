"""The whole method on one page: one frame in, one face out.

After Zhang, Yu, Wang, Dong, Liu, "Dense 3D Facial Reconstruction from a Single Depth Image in
Unconstrained Environment".
"""

import time
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

import cv2
import numpy as np

from denseface.arguments import expect
from denseface.capture.doubts import doubts_of
from denseface.capture.frame import FrameOrigin, RgbdFrame
from denseface.recon.arrays import Floats
from denseface.recon.detail import beyond_outline
from denseface.recon.detection import REJECTED
from denseface.recon.errors import (
    ImpossibleFrameError,
    NoFaceError,
    ReconstructionError,
    TooLittleDepthError,
)
from denseface.recon.face import Face, FaceCandidate, PointCloud, Report, Seeds
from denseface.recon.finding import Found, find_another, find_face
from denseface.recon.fitting import plan_fit, surface_of
from denseface.recon.judgement import (
    LEAST_COLOR_LIKENESS,
    LEAST_SCORE,
    SURE_SCORE,
    check_face,
    check_steps,
    color_likeness,
    judge_shape,
)
from denseface.recon.noise import Noise, measure_noise
from denseface.recon.numerics.threads import one_blas_thread
from denseface.recon.openings import Openings, openings
from denseface.recon.propagation import densify
from denseface.recon.registration import own_readings, pooled, register, sample_colors
from denseface.recon.segmentation import box_window, segment_face
from denseface.recon.settings import Settings
from denseface.recon.surface import MIN_SEEDS, mean_spacing
from denseface.recon.warmup import warm
from denseface.version import VERSION

__all__ = ["ends_the_same", "reconstruct"]

_FEW_SEEDS = 2000
"""With fewer seeds, the report warns."""
_MOST_MM = 1000.0
"""Seeds farther apart, along x or y, are not on a face."""
_READINGS = 10_000
"""So many around a face, at least, tell in which steps depth comes."""
_TRIES = 3
"""So many boxes are shaped, at most, until one is a face for sure."""
_DOUBTFUL = "a face, perhaps"
"""Verdict on a box that was looked past for a surer one."""
_MUCH_SKEW_US = 33_000
"""A whole frame at 30 frames a second: the face may have moved in between."""

_OF_THE_NUMBERS = (ReconstructionError, ArithmeticError, LookupError, ValueError, cv2.error)
"""What the numbers of a frame can lead to, where nothing sees to it beforehand. Not lack of memory,
which another attempt may have."""


@one_blas_thread
def reconstruct(frame: RgbdFrame, settings: Settings | None = None) -> Face:
    """Turn one depth + colour frame into a dense, coloured face.

    The first call in a process runs `warm` first, which the report's times leave out.

    Parameters
    ----------
    frame : depth and colour with their calibration; without colour the face is found by its relief
    settings : the `best` preset where None

    Returns
    -------
    Face
        Both clouds in the depth camera's frame, mm, and the report.

    Raises
    ------
    TypeError
        Where `frame` is no frame, or `settings` no settings.
    ReconstructionError
        `NoDepthError`, `NoFaceError`, `FaceWithoutDepthError`, `TooLittleDepthError`,
        `CoarseDepthError` or `ImpossibleFrameError`: the same for the same frame, so trying it
        again does not help.
    """
    expect("frame", frame, RgbdFrame, "iterating over open_source(uri) gives some")
    settings = Settings() if settings is None else settings
    expect("settings", settings, Settings, "Settings.of(preset) makes some")
    warm()
    clock = _Stopwatch()
    try:
        return _reconstruct(frame, settings, clock)
    except ReconstructionError:
        raise
    except Exception as error:
        if not ends_the_same(error):
            raise
        reason = " ".join(str(error).split())[:200]
        raise ImpossibleFrameError(
            f"after {clock.last}: {type(error).__name__}: {reason}: is the calibration right?"
        ) from error


def ends_the_same(error: Exception) -> bool:
    """Say whether another attempt would end so too: by the frame's numbers, not the machine."""
    out_of_memory = isinstance(error, cv2.error) and error.code == cv2.Error.StsNoMem
    return isinstance(error, _OF_THE_NUMBERS) and not out_of_memory


def _reconstruct(frame: RgbdFrame, settings: Settings, clock: "_Stopwatch") -> Face:
    found = find_face(frame, clock.lap)
    return _surest(found, clock, partial(_shape, settings, clock))


def _surest(found: Found, clock: "_Stopwatch", shape: Callable[[Found], Face]) -> Face:
    """Shape what was found; where that is no face, or may be none, what else is found, too."""
    best: Face | None = None
    refusals: list[ReconstructionError] = []
    passed: tuple[FaceCandidate, ...] = ()
    while len(passed) < _TRIES:
        verdict, candidates = _DOUBTFUL, found.detection.candidates
        try:
            face = shape(found.among(candidates + passed))
            best = face if best is None else max(best, face, key=_score)
            if _score(best) >= SURE_SCORE:
                break
        except NoFaceError as error:
            verdict = REJECTED
            error.candidates = _first_is(verdict, candidates) + passed
            refusals.append(error)
        except ReconstructionError as error:
            error.candidates = candidates + passed
            refusals.append(error)
            break
        passed += _first_is(verdict, candidates[:1])
        try:
            found = find_another(found, tuple(one.box for one in passed))
        except ReconstructionError:
            break
        clock.lap("detection")
    if best is None:
        raise refusals[0]
    return best


def _first_is(verdict: str, candidates: tuple[FaceCandidate, ...]) -> tuple[FaceCandidate, ...]:
    return (candidates[0].model_copy(update={"verdict": verdict}), *candidates[1:])


def _score(face: Face) -> float:
    return face.report.face_score or 0.0


def _shape(settings: Settings, clock: "_Stopwatch", found: Found) -> Face:
    """Go on from the face's box."""
    frame, box = found.frame, found.detection.box
    if not found.colored:
        settings = settings.model_copy(update={"shading": False})
    focal_px = frame.calibration.color.fx
    side = _pixels_each_way(settings, found)
    window = box_window(found.overview, box, side)
    coarse = check_steps(_some_readings(frame, window), found.detection.depth_mm)
    seen = frame
    if side > 1:
        seen, window = pooled(frame, window, side)
    registered = register(seen, *window)
    clock.lap("registration")
    seeds = segment_face(registered, box, focal_px)
    _check_seeds(seeds.points)
    check_face(seeds.points, 1 / (seen.depth_camera.fx * seen.depth_camera.fy), box)
    clock.lap("segmentation")
    spacing = mean_spacing(seeds.points, seeds.pixels, settings.neighbors)
    clock.lap("neighbors")
    sampler = partial(sample_colors, seen, registered)
    noise = _noise(frame, seeds, spacing, side)
    plan = plan_fit(settings, noise.averaged(side), spacing)
    surface = surface_of(seeds.points, spacing, settings, plan, sampler)
    clock.lap("rbf")
    judgement = judge_shape(surface)
    score, like, placement = judgement
    doubts = [coarse]
    if placement is not None and found.colored and not like:
        doubts.append(_doubt_colors(color_likeness(placement, seeds.points, seeds.colors)))
        if doubts[-1] and score < SURE_SCORE:
            like = "doubtful in its shape, and no darker where eyes, brows and mouth would be"
    clock.lap("judgement")
    if like:
        raise NoFaceError(f"no face found: what the box at {box} shows is {like} "
                          f"(score {score:.2f}, a face has {LEAST_SCORE} or more)")
    if settings.prior:  # after the judgement: what a model adds is like a face
        surface = beyond_outline(surface, partial(_depths_at, frame), judgement.pose)
    dense = densify(seeds, surface, spacing, settings.ratio, plan, sampler)
    left_open = openings(dense)
    clock.lap("propagation")
    initial = PointCloud(seeds.points, seeds.colors)
    report = Report(
        face_box=box, candidates=found.detection.candidates,
        initial_points=len(initial), dense_points=len(dense),
        mean_spacing_mm=spacing, r0_mm=plan.r0_factor * spacing, smoothing=plan.smoothing,
        noise_mm=noise.total_mm, noise_correlation_px=noise.correlation_px,
        quantum_mm=noise.quantum_mm, face_score=score,
        timings_ms=clock.timings_ms(), settings=settings,
        calibration=frame.calibration_origin, skew_us=frame.skew_us,
        colored=found.colored, registered=frame.registered and found.colored,
        depth_unit_um=frame.depth_meaning.unit_um,
        depth_rounding=frame.depth_meaning.rounding, **_of_origin(frame.origin),
        version=VERSION,
        warnings=_warnings(found, len(initial), doubts, left_open, score),
    )
    return Face(initial, dense, report)


def _pixels_each_way(settings: Settings, found: Found) -> int:
    """Say how many of the depth's pixels each way are averaged on the face."""
    if settings.pixel_mm is None:
        return 1
    focal_px = max(found.frame.depth_camera.fx, found.frame.depth_camera.fy)
    return max(1, int(settings.pixel_mm * focal_px / found.detection.depth_mm))


def _noise(frame: RgbdFrame, seeds: Seeds, spacing: float, side: int) -> Noise:
    """Measure the noise of the sensor's own pixels, of which seeds are so many each way."""
    if side == 1:
        return measure_noise(seeds.points, seeds.pixels, spacing)
    points, pixels = own_readings(
        frame, seeds.pixels, np.ascontiguousarray(seeds.points[:, 2]), side)
    return measure_noise(points, pixels, spacing / side)


def _some_readings(frame: RgbdFrame, window: tuple[slice, slice]) -> Floats:
    """Give some of the depths that were read in a window, (n,) float32, mm."""
    meaning = frame.depth_meaning
    counts = frame.depth[window].ravel()
    read = np.flatnonzero((counts > 0) & (counts <= meaning.max_count))
    some = counts[read[::max(1, len(read) // _READINGS)]]
    return some * np.float32(meaning.unit_um / 1000) + np.float32(meaning.offset_mm)


def _of_origin(origin: FrameOrigin) -> dict[str, Any]:
    """Give what the report repeats of a frame's origin; its notes are among the warnings."""
    return {field.name: getattr(origin, field.name) for field in fields(origin)
            if field.name != "notes"}


def _check_seeds(points: Floats) -> None:
    """See to it that there are enough, and no farther apart than on a face."""
    if len(points) < MIN_SEEDS:
        raise TooLittleDepthError(
            f"{len(points)} depth readings on the face, a fit needs at least {MIN_SEEDS}")
    width, height = np.ptp(np.ascontiguousarray(points[:, :2].T), axis=1)
    if not max(width, height) <= _MOST_MM:
        raise ImpossibleFrameError(f"the readings on the face are {width:.6g} x {height:.6g} mm "
                                   "across: is the calibration right?")


def _doubt_colors(likeness: float | None) -> str:
    """Warn where eyes, brows and mouth are elsewhere in colour than in depth."""
    if likeness is None or likeness >= LEAST_COLOR_LIKENESS:
        return ""
    return (f"eyes, brows and mouth are not seen where depth has them (likeness {likeness:.2f}, "
            f"mostly {LEAST_COLOR_LIKENESS} or more): do depth and colour belong together, is an "
            "image mirrored?")


def _depths_at(frame: RgbdFrame, points: Floats) -> Floats:
    """Give what was read where points, (n, 3) mm, are seen: (n,) float32, mm; 0 where nothing."""
    columns, rows = np.rint(frame.depth_camera.project(points)).T
    height, width = frame.depth.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    found = np.zeros(len(points), np.float32)
    counts = frame.depth[rows[inside].astype(np.intp), columns[inside].astype(np.intp)]
    meaning = frame.depth_meaning
    z = counts * np.float32(meaning.unit_um / 1000) + np.float32(meaning.offset_mm)
    found[inside] = np.where((counts > 0) & (counts <= meaning.max_count), z, 0)
    return found


def _warnings(
    found: Found, seeds: int, doubts: list[str], left_open: Openings, score: float
) -> tuple[str, ...]:
    frame = found.frame
    warnings = [*frame.origin.notes, *filter(None, doubts)]
    # Who read the frame from somewhere was told; who made it was not.
    in_one_image = frame.registered or not found.colored
    warnings += [doubt for doubt in doubts_of(frame.calibration, in_one_image)
                 if doubt not in warnings]
    if found.warning:
        warnings.append(found.warning)
    if seeds < _FEW_SEEDS:
        warnings.append(f"only {seeds} seeds: the face is far away or mostly unmeasured")
    if left_open.holes:
        width, height = left_open.largest_mm
        warnings.append(f"{left_open.holes} hole{'s' * (left_open.holes > 1)} in the surface left "
                        f"open, up to {width:.1f} x {height:.1f} mm: the depth around steps too "
                        "far for one surface")
    if score < SURE_SCORE:
        warnings.append(f"its shape is not surely a face's (score {score:.2f}): is it one, all of "
                        "it, and do depth and colour belong together?")
    if abs(frame.skew_us) > _MUCH_SKEW_US:
        warnings.append(f"depth and colour were taken {frame.skew_us / 1000:.1f} ms apart")
    return tuple(warnings)


class _Stopwatch:
    def __init__(self) -> None:
        self._start = self._last = time.perf_counter()
        self._laps: dict[str, float] = {}

    @property
    def last(self) -> str:
        """Name of the last lap."""
        return next(reversed(self._laps), "nothing")

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self._laps[name] = self._laps.get(name, 0.0) + (now - self._last) * 1e3
        self._last = now

    def timings_ms(self) -> dict[str, float]:
        return self._laps | {"total": (time.perf_counter() - self._start) * 1e3}
