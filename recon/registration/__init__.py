"""Stage 1: every depth pixel as a 3D point, and where the colour camera sees it."""

from denseface.recon.registration._pooling import own_readings, pooled
from denseface.recon.registration._register import register, sample_colors
from denseface.recon.registration._shaded_depth import (
    shaded_depth,
    with_shaded_depth,
    without_color,
)

__all__ = [
    "own_readings", "pooled", "register", "sample_colors", "shaded_depth", "with_shaded_depth",
    "without_color",
]
