"""Stages 4 and 5: the mean spacing of the seeds, and the RBF fit over them."""

from denseface.recon.surface._rbf import MIN_SEEDS, Surface, fit_surface
from denseface.recon.surface._spacing import exact_spacing, mean_spacing

__all__ = ["MIN_SEEDS", "Surface", "exact_spacing", "fit_surface", "mean_spacing"]
