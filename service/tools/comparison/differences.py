"""How far surfaces stand out of a reference, place by place, along its normals."""

import numpy as np
from numpy.typing import NDArray

from denseface.service.tools.comparison.surface import Surface

__all__ = ["SITE_MM", "distances", "sites_of"]

SITE_MM = 3.0
"""Distance of the places where surfaces are compared: they are smooth over more."""
_LEAST_COSINE = 0.5
"""Normals that differ by more belong to different parts."""
_ASIDE_MM = 2.0
"""The surface's nearest point is no farther beside a place's normal, or there is a hole."""
_MOST_MM = 15.0
"""Larger distances are of other things: hair, a hand, cloth."""
_NEAREST = 4
"""Tangent planes of so many nearest points are averaged."""


def sites_of(surface: Surface, apart_mm: float = SITE_MM) -> Surface:
    """Choose the places of a reference surface where others are compared with it."""
    return surface.thinned(apart_mm)


def distances(
    surface: Surface, sites: Surface
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measure how far a surface is from places, along their normals; positive outward.

    Parameters
    ----------
    surface : in the places' frame

    Returns
    -------
    distances, (n,) mm, and the surface's standard errors there, (n,) mm; NaN where it is not
    """
    away, nearest = surface.nearest(sites.points, _NEAREST, _MOST_MM + _ASIDE_MM)
    met = np.isfinite(away).all(axis=1)
    distance, sigma = np.full((2, len(sites)), np.nan)
    p, n = sites.points[met, None], sites.normals[met, None]
    q, m = surface.points[nearest[met]], surface.normals[nearest[met]]
    cosine = (n * m).sum(axis=2)
    along = ((q - p) * m).sum(axis=2) / np.maximum(cosine, _LEAST_COSINE)
    aside = q - p - ((q - p) * n).sum(axis=2, keepdims=True) * n
    beside = np.linalg.norm(aside, axis=2)
    good = (cosine[:, 0] > _LEAST_COSINE) & (beside[:, 0] < _ASIDE_MM) & (
        np.abs(along[:, 0]) < _MOST_MM)
    weight = np.where((cosine > _LEAST_COSINE) & (beside < _ASIDE_MM), 1.0, 0.0)
    weight[:, 0] += 1e-9
    weight /= weight.sum(axis=1, keepdims=True)
    distance[met] = np.where(good, (weight * along).sum(axis=1), np.nan)
    sigma[met] = np.where(good, (weight * surface.sigma[nearest[met]]).sum(axis=1), np.nan)
    return distance, sigma
