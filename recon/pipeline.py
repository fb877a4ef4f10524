"""The whole method on one page: one frame in, one face out.

After Zhang, Yu, Wang, Dong, Liu, "Dense 3D Facial Reconstruction from a Single Depth Image in
Unconstrained Environment".
"""

import time
from functools import cache, partial
from importlib.metadata import version

from denseface.capture.frame import RgbdFrame
from denseface.recon.arrays import Floats
from denseface.recon.detail import add_detail
from denseface.recon.detection import detect_face
from denseface.recon.errors import NoDepthError, TooLittleDepthError
from denseface.recon.face import Face, PointCloud, Report
from denseface.recon.intermediate import ColorSampler, Registration, SurfaceGrid
from denseface.recon.numerics.threads import one_blas_thread
from denseface.recon.propagation import densify, noise_fraction
from denseface.recon.registration import register, sample_colors
from denseface.recon.segmentation import box_window, segment_face
from denseface.recon.settings import Settings
from denseface.recon.support import Support
from denseface.recon.surface import MIN_SEEDS, fit_surface, mean_spacing

__all__ = ["reconstruct", "surface_of"]

_FEW_SEEDS = 2000
"""With fewer seeds, the report warns."""
_SPARSE = 4
"""Every so many pixels are enough to find a face and weigh its depth."""
_MUCH_SKEW_US = 33_000
"""A whole frame at 30 frames a second: the face may have moved in between."""


@one_blas_thread
def reconstruct(frame: RgbdFrame, settings: Settings | None = None) -> Face:
    """Turn one depth + colour frame into a dense, coloured face.

    Parameters
    ----------
    frame : depth, mm, and colour with their calibration
    settings : the `best` preset where None

    Returns
    -------
    Face
        Both clouds in the depth camera's frame, mm, and the report.

    Raises
    ------
    ReconstructionError
        `NoDepthError`, `NoFaceError`, `FaceWithoutDepthError` or `TooLittleDepthError`.
    """
    settings = settings or Settings()
    focal_px = frame.calibration.color.fx
    clock = _Stopwatch()
    overview = _overview(frame, settings.depth_offset_mm)
    clock.lap("overview")
    found = detect_face(frame.color, overview, focal_px)
    clock.lap("detection")
    registered = register(frame, settings.depth_offset_mm, *box_window(overview, found.box))
    clock.lap("registration")
    seeds = segment_face(registered, found.box, focal_px)
    if len(seeds.points) < MIN_SEEDS:
        raise TooLittleDepthError(
            f"{len(seeds.points)} depth readings on the face, a fit needs at least {MIN_SEEDS}")
    clock.lap("segmentation")
    spacing = mean_spacing(seeds.points, seeds.pixels, settings.neighbors)
    clock.lap("neighbors")
    sampler = partial(sample_colors, frame, registered)
    surface = surface_of(seeds.points, spacing, settings, sampler)
    clock.lap("rbf")
    dense = densify(seeds, surface, spacing, settings.ratio, noise_fraction(settings), sampler)
    clock.lap("propagation")
    initial = PointCloud(seeds.points, seeds.colors)
    report = Report(
        face_box=found.box, candidates=found.candidates,
        initial_points=len(initial), dense_points=len(dense),
        mean_spacing_mm=spacing, r0_mm=settings.r0_factor * spacing, noise_mm=surface.noise,
        timings_ms=clock.timings_ms(), settings=settings,
        calibration=frame.calibration_origin, skew_us=frame.skew_us,
        version=_version(), warnings=_warnings(frame, len(initial)),
    )
    return Face(initial, dense, report)


def _overview(frame: RgbdFrame, depth_offset_mm: float) -> Registration:
    """Register every k-th pixel, or all where none of those has a depth."""
    sparse = slice(None, None, _SPARSE)
    try:
        return register(frame, depth_offset_mm, sparse, sparse, colors=False)
    except NoDepthError:
        return register(frame, depth_offset_mm, colors=False)


@cache
def _version() -> str:
    return version("denseface")


def surface_of(
    points: Floats, spacing: float, settings: Settings, sampler: ColorSampler | None = None
) -> SurfaceGrid:
    """Fit the seeds, and add the detail that the settings ask for.

    Parameters
    ----------
    points : (n, 3) float32, mm, depth camera frame
    spacing : their mean spacing, mm
    sampler : tells points' colours; None, and there is no detail by shading

    Raises
    ------
    TooLittleDepthError
        Where there are too few points, or all on a line.
    """
    fit = fit_surface(points, settings.r0_factor * spacing, settings.smoothing)
    support = Support.of(points, spacing)
    if settings.detail_factor is None:
        return fit.on_support(support)
    return add_detail(
        fit.heights(support.xs, support.ys), support, points, spacing,
        settings.detail_factor * spacing, symmetry=settings.symmetry,
        sampler=sampler if settings.shading else None)


def _warnings(frame: RgbdFrame, seeds: int) -> tuple[str, ...]:
    found = []
    if seeds < _FEW_SEEDS:
        found.append(f"only {seeds} seeds: the face is far away or mostly unmeasured")
    if abs(frame.skew_us) > _MUCH_SKEW_US:
        found.append(f"depth and colour were taken {frame.skew_us / 1000:.1f} ms apart")
    return tuple(found)


class _Stopwatch:
    def __init__(self) -> None:
        self._start = self._last = time.perf_counter()
        self._laps: dict[str, float] = {}

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self._laps[name] = (now - self._last) * 1e3
        self._last = now

    def timings_ms(self) -> dict[str, float]:
        return self._laps | {"total": (time.perf_counter() - self._start) * 1e3}
