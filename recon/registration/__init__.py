"""Stage 1: every depth pixel as a 3D point, and where the colour camera sees it."""

from denseface.recon.registration._register import register, sample_colors

__all__ = ["register", "sample_colors"]
