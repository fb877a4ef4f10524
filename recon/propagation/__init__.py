"""Stage 6: the dense cloud, its colours and its standard error."""

from denseface.recon.propagation._densify import densify

__all__ = ["densify"]
