"""Stage 1: every depth pixel as a 3D point, and where the colour camera sees it."""

from denseface.recon.registration._register import (
    ColorSampler,
    Registration,
    register,
    sample_colors,
)

__all__ = ["ColorSampler", "Registration", "register", "sample_colors"]
