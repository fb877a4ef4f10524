"""Detail that the broad fit smooths away: local averages, rim, holes, symmetry, shading."""

from denseface.recon.detail._detail import add_detail

__all__ = ["add_detail"]
