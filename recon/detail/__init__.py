"""Detail that the broad fit smooths away: local averages, rim, holes, symmetry, shading."""

from denseface.recon.detail._beyond import beyond_outline
from denseface.recon.detail._detail import add_detail
from denseface.recon.detail._mirror_kernels import HeightField
from denseface.recon.detail._mirror_plane import MirrorPlane, find_plane

__all__ = ["HeightField", "MirrorPlane", "add_detail", "beyond_outline", "find_plane"]
