"""A fitted surface's own formula, in double precision."""

import numpy as np

from denseface.recon.surface import Surface


def evaluated(surface: Surface, xy: np.ndarray) -> np.ndarray:
    """Heights at scattered points: (n, 2) mm -> (n,) mm."""
    x, y = xy.T
    in_x, in_y = (np.exp(-2 * ((values[:, None] - nodes) / surface.r0) ** 2)
                  for values, nodes in ((x, surface.nodes_x), (y, surface.nodes_y)))
    u, v = ((xy - surface.center) / surface.scale).T
    terms = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
    return np.einsum("ij,ij->i", in_y @ surface.alpha, in_x) + terms @ surface.beta
