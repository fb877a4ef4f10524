"""Seeds to a surface: the broad fit, and the detail that the settings ask for."""

from denseface.recon.arrays import Floats
from denseface.recon.detail import add_detail
from denseface.recon.intermediate import ColorSampler, SurfaceGrid
from denseface.recon.settings import Settings
from denseface.recon.support import Support
from denseface.recon.surface import fit_surface

__all__ = ["surface_of"]


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
