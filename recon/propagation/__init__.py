"""Stage 6: the dense cloud, its colours and its standard error."""

from denseface.recon.propagation._densify import densify
from denseface.recon.propagation.uncertainty import noise_fraction

__all__ = ["densify", "noise_fraction"]
