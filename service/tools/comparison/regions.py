"""Places on a face, by the mean face that was laid on it: their names, and which are of bone.

The mean face's frame: x right in the image, so the person's left; y down; the chin is at y = 90
units below the middle, the tip of the nose at (0, 10), the root of the nose at (0, -25). A unit is
about a millimetre.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from denseface.recon.judgement import judge_points
from denseface.service.tools.comparison.surface import Pose, Surface

__all__ = ["HeadPlace", "foremost", "region_name", "rigidity"]

_EVERY_MM = 4.0
"""The mean face is laid on points so far apart."""
_SOFT = 0.2
"""Weight of what moves: lids, lips, lower cheeks, jaw."""


@dataclass(frozen=True, eq=False)
class HeadPlace:
    """How the mean face lies on a surface.

    Attributes
    ----------
    pose : from its frame to the surface's
    scale : mm for each of its units
    score : how sure it is that there is a face, 0-1
    """

    pose: Pose
    scale: float
    score: float

    @classmethod
    def find(cls, surface: Surface) -> Self | None:
        """Lay the mean face on what a camera at the origin sees; None where nothing is alike.

        What it sees is told by the foremost points alone: normals may point in.
        """
        if not len(surface):
            return None
        judged = judge_points(np.ascontiguousarray(surface.points[foremost(surface.points)]))
        if judged.placement is None or not np.isfinite(judged.placement).all():
            return None
        p = judged.placement
        return cls(Pose(p[:9].reshape(3, 3).copy(), p[9:12].copy()), float(p[12]), judged.score)

    def own(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Give points, (n, 3) mm, in the mean face's frame and units."""
        return self.pose.inverse.of(points) / self.scale

    def moved(self, pose: Pose) -> "HeadPlace":
        """Give it for the surface moved."""
        return HeadPlace(pose @ self.pose, self.scale, self.score)


def foremost(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Give the rows of the foremost points in each square of `_EVERY_MM` along x and y."""
    cells = np.floor(points[:, :2] / _EVERY_MM).astype(np.int64)
    order = np.lexsort((points[:, 2], *cells.T))
    first = np.ones(len(order), bool)
    first[1:] = (cells[order[1:]] != cells[order[:-1]]).any(axis=1)
    return np.asarray(order[first], np.int64)


_REGIONS = (
    # name, whether each side has one, |x| from and to, y from and to, of bone
    ("root of the nose", False, 0, 11, -34, -8, True),
    ("nose", False, 0, 20, -8, 25, True),
    ("forehead", False, 0, 200, -200, -48, True),
    ("brow", True, 0, 52, -48, -33, True),
    ("eye", True, 11, 50, -33, -10, False),
    ("temple", True, 50, 200, -48, -8, True),
    ("upper lip", False, 0, 27, 25, 36, False),
    ("mouth", False, 0, 27, 36, 54, False),
    ("cheekbone", True, 20, 200, -10, 15, True),
    ("cheek", True, 20, 200, 15, 56, False),
    ("chin", False, 0, 25, 54, 200, False),
    ("jaw", True, 25, 200, 56, 200, False),
)


def region_name(place: NDArray[np.floating]) -> str:
    """Name a place, (3,) in the mean face's frame: `left cheek` is on the person's own left."""
    x, y = float(place[0]), float(place[1])
    for name, sided, low, high, top, bottom, _ in _REGIONS:
        if low <= abs(x) < high and top <= y < bottom:
            return f"{'left' if x > 0 else 'right'} {name}" if sided else name
    return "face"


def rigidity(places: NDArray[np.floating]) -> NDArray[np.float64]:
    """Give the weights of places, (n, 3) in the mean face's frame, where a head is laid on."""
    x, y = np.abs(places[:, 0]), places[:, 1]
    weights = np.full(len(places), _SOFT)
    for _, _, low, high, top, bottom, bone in reversed(_REGIONS):
        inside = (x >= low) & (x < high) & (y >= top) & (y < bottom)
        weights[inside] = 1.0 if bone else _SOFT
    return weights
