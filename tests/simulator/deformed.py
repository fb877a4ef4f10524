"""Faces whose sides differ, or that changed: `load_head("NAME+KIND")`, as `procedural+swollen`.

`NAME+raised:0.5:20:38:52`: raised by 0.5 mm, 20 mm wide at half that, at x = 38 and y = 52 mm.
"""

from enum import StrEnum
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tests.simulator.landmarks import Landmarks

__all__ = ["Deformed", "Patch", "Raised", "displacement", "patch"]

_FRONT_MM = 40.0
_FWHM = float(2 * np.sqrt(2 * np.log(2)))
"""Width of a Gaussian at half its height, standard deviations."""


class Deformed(StrEnum):
    """What one side has that the other has not."""

    BUMP = "bump"
    """4 mm high, 14 mm wide at half its height, on the cheek."""
    SWOLLEN = "swollen"
    """6 mm high, 26 mm wide, beside the mouth."""
    DENT = "dent"
    """3 mm deep, 16 mm wide, in the forehead."""
    SCAR = "scar"
    """2 mm deep, 8 mm wide and 33 mm long, down the cheek."""
    CROOKED_MOUTH = "mouth"
    """One corner 6 mm lower."""
    BENT_NOSE = "nose"
    """Its tip 6 mm aside."""


class Raised(NamedTuple):
    """A smooth bump, head frame, mm: as a Gaussian, along the surface's normals."""

    height: float
    """At its top; negative for a dent."""
    width: float
    """At half its height."""
    x: float
    y: float

    @classmethod
    def parse(cls, kind: str) -> Self | None:
        """Read `raised:HEIGHT:WIDTH:X:Y`; None for another kind."""
        name, *values = kind.split(":")
        return cls(*map(float, values)) if name == "raised" else None

    def __str__(self) -> str:
        return ":".join(["raised", *(f"{value:g}" for value in self)])

    def displacement(
        self, vertices: NDArray[np.float32], normals: NDArray[np.float32], marks: Landmarks
    ) -> NDArray[np.float32]:
        """Give how far each vertex moves, (n, 3) mm, as `displacement`."""
        near = _near(vertices, self.x, self.y, self.width / _FWHM, marks)
        return np.asarray(self.height * normals * near, np.float32)


class Patch(NamedTuple):
    """A disc of the face, head frame, mm."""

    x: float
    y: float
    radius: float


def patch(kind: Deformed, marks: Landmarks) -> Patch:
    """Say where a deformation is; at -x is what the other side has there."""
    _, eye, _ = marks.eyes
    nose, mouth = marks.nose_tip[0], marks.mouth[0]
    x, y, radius = {
        Deformed.BUMP: (38, (nose + mouth) / 2, 12), Deformed.SWOLLEN: (40, mouth - 8, 20),
        Deformed.DENT: (-26, eye - 38, 13), Deformed.SCAR: (36, nose + 5, 14),
        Deformed.CROOKED_MOUTH: (20, mouth, 16), Deformed.BENT_NOSE: (0, nose, 18),
    }[kind]
    return Patch(x, y, radius)


def displacement(
    kind: Deformed, vertices: NDArray[np.float32], normals: NDArray[np.float32], marks: Landmarks
) -> NDArray[np.float32]:
    """Give how far each vertex moves, (n, 3) mm, head frame, of vertices in it."""
    x, y, _ = patch(kind, marks)
    if kind is Deformed.CROOKED_MOUTH:
        moved = np.array([0, 6, 0]) * _near(vertices, x, y, 12, marks)
    elif kind is Deformed.BENT_NOSE:
        moved = np.array([6, 0, 0]) * _near(vertices, x, y, 12, marks)
    else:
        height, wide, long = {Deformed.BUMP: (4, 6, 6), Deformed.SWOLLEN: (6, 11, 11),
                              Deformed.DENT: (-3, 7, 7), Deformed.SCAR: (-2, 3.5, 14)}[kind]
        moved = height * normals * _near(vertices, x, y, wide, marks, long)
    return np.asarray(moved, np.float32)


def _near(
    vertices: NDArray[np.float32], x: float, y: float, wide: float, marks: Landmarks,
    long: float | None = None,
) -> NDArray[np.float64]:
    """A Gaussian over the front of the head, (n, 1)."""
    across, down = (vertices[:, 0] - x) / wide, (vertices[:, 1] - y) / (long or wide)
    near = np.exp(-(across**2 + down**2) / 2) * (vertices[:, 2] < marks.eyes[2] + _FRONT_MM)
    return np.asarray(near[:, None], np.float64)
