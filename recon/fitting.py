"""Seeds to a surface: the broad fit, and the detail that the settings ask for."""

from denseface.recon.arrays import Floats
from denseface.recon.detail import add_detail
from denseface.recon.intermediate import ColorSampler, SurfaceGrid
from denseface.recon.noise import Noise, Risk, least_risk
from denseface.recon.settings import Settings
from denseface.recon.support import Support
from denseface.recon.surface import fit_surface

__all__ = ["plan_fit", "surface_of"]


def plan_fit(settings: Settings, noise: Noise, spacing: float) -> Risk:
    """Give R0 and lambda: those of the settings, or of the least expected error.

    noise : of the frame; spacing : mean spacing of its seeds, mm
    """
    return least_risk(noise, spacing, settings.detail_factor, settings.r0_factor,
                      settings.smoothing)


def surface_of(
    points: Floats, spacing: float, settings: Settings, plan: Risk,
    sampler: ColorSampler | None = None,
) -> SurfaceGrid:
    """Fit the seeds, and add the detail that the settings ask for.

    Parameters
    ----------
    points : (n, 3) float32, mm, depth camera frame
    spacing : their mean spacing, mm
    plan : R0 and lambda, and the error that is expected of them
    sampler : tells points' colours; None, and there is no detail by shading

    Raises
    ------
    TooLittleDepthError
        Where there are too few points, or all on a line.
    """
    fit = fit_surface(points, plan.r0_factor * spacing, plan.smoothing)
    support = Support.of(points, spacing)
    if settings.detail_factor is None:
        return fit.on_support(support)
    return add_detail(
        fit.heights(support.xs, support.ys), support, points, spacing,
        settings.detail_factor * spacing, plan, symmetry=settings.symmetry,
        sampler=sampler if settings.shading else None)
