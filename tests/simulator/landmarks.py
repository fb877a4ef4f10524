"""Where the parts of a face are on each head, and what counts as face."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["SCANS", "Landmarks"]

Point = tuple[float, float]


@dataclass(frozen=True)
class Landmarks:
    """Places on a head in mm, each (y, z) in the plane of symmetry or seen from the side.

    The face is forehead to chin and ear to ear: in front of the ears, below a plane from the
    hairline to the top of the ears, above a plane from under the chin to below the ears.
    """

    bridge: Point
    """Bridge of the nose: (y, z)."""
    hairline: Point
    chin: Point
    """The lowest point of the chin that still looks forward."""
    ear_top: Point
    """Top of the ear's front edge."""
    ear_bottom: Point
    eyes: tuple[float, float, float]
    """(x, y, z) of the eye at +x; the other is its mirror image."""
    nose_tip: Point
    mouth: Point
    neck: tuple[float, float, float, float]
    """Where the neck meets the clothes: half width x, y, z of its middle, half depth."""

    @property
    def origin(self) -> tuple[float, float, float]:
        """The head frame's origin."""
        return (0.0, (self.hairline[0] + self.chin[0]) / 2, self.bridge[1])

    def relative_to_origin(self) -> Self:
        """Give the same landmarks in the head frame."""
        _, dy, dz = self.origin

        def moved(point: Point) -> Point:
            return point[0] - dy, point[1] - dz

        return replace(
            self, bridge=moved(self.bridge), hairline=moved(self.hairline), chin=moved(self.chin),
            ear_top=moved(self.ear_top), ear_bottom=moved(self.ear_bottom),
            eyes=(self.eyes[0], self.eyes[1] - dy, self.eyes[2] - dz),
            nose_tip=moved(self.nose_tip), mouth=moved(self.mouth),
            neck=(self.neck[0], self.neck[1] - dy, self.neck[2] - dz, self.neck[3]),
        )

    def face_region(self, points: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Say which points, (..., 3) mm, in the landmarks' own frame, belong to the face."""
        y, z = points[..., 1], points[..., 2]
        ear = min(self.ear_top[1], self.ear_bottom[1])
        top = _line(z, self.hairline, (self.ear_top[0], ear))
        bottom = _line(z, self.chin, (self.ear_bottom[0] + 12, ear))
        inside: NDArray[np.bool_] = (z < ear) & (y > top) & (y < bottom)
        return inside


def _line(z: NDArray[np.floating], front: Point, back: Point) -> NDArray[np.floating]:
    """Give y at z on the line through two (y, z), level in front of the first."""
    slope = (back[0] - front[0]) / (back[1] - front[1])
    line: NDArray[np.floating] = front[0] + slope * np.maximum(z - front[1], 0)
    return line


# Read from front and side views of each mesh with a grid of millimetres, mesh coordinates.
SCANS: dict[str, Landmarks] = {
    "lps": Landmarks(
        bridge=(-88, -108), hairline=(-160, -95), chin=(36, -100), ear_top=(-92, -27),
        ear_bottom=(-35, -27), eyes=(33, -88, -92), nose_tip=(-55, -130), mouth=(-22, -113),
        neck=(58, 56, 18, 60)),
    "ict_neutral": Landmarks(
        bridge=(0, -107), hairline=(-72, -90), chin=(117, -100), ear_top=(2, -21),
        ear_bottom=(55, -21), eyes=(33, 0, -95), nose_tip=(32, -131), mouth=(69, -114),
        neck=(62, 148, 10, 56)),
    "ict_id1": Landmarks(
        bridge=(0, -107), hairline=(-68, -92), chin=(120, -100), ear_top=(2, -23),
        ear_bottom=(58, -23), eyes=(33, 0, -95), nose_tip=(38, -128), mouth=(69, -112),
        neck=(66, 146, 8, 58)),
    "ict_id2": Landmarks(
        bridge=(0, -107), hairline=(-78, -88), chin=(136, -97), ear_top=(-8, -19),
        ear_bottom=(50, -19), eyes=(33, 0, -95), nose_tip=(45, -133), mouth=(74, -115),
        neck=(74, 166, 16, 64)),
    "mh_cauc_m": Landmarks(
        bridge=(0, -30), hairline=(-72, -18), chin=(114, -16), ear_top=(0, 64),
        ear_bottom=(46, 64), eyes=(32, 0, -16), nose_tip=(42, -45), mouth=(72, -26),
        neck=(60, 134, 88, 56)),
    "mh_asian_f": Landmarks(
        bridge=(0, -23), hairline=(-62, -10), chin=(99, -8), ear_top=(0, 48),
        ear_bottom=(40, 48), eyes=(28, 0, -14), nose_tip=(38, -32), mouth=(63, -20),
        neck=(48, 126, 84, 48)),
    "mh_afr_f": Landmarks(
        bridge=(0, -30), hairline=(-62, -12), chin=(101, -18), ear_top=(2, 50),
        ear_bottom=(50, 50), eyes=(29, 0, -20), nose_tip=(38, -46), mouth=(62, -40),
        neck=(48, 132, 80, 48)),
}
