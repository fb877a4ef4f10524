"""What stands before the sensor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

__all__ = ["Light", "Person", "Scene"]


@dataclass(frozen=True)
class Person:
    """One person, upright, looking at the sensor but for the turn of the head."""

    head: str = "procedural"
    """A name of `heads.head_names()`."""
    distance_mm: float = 700.0
    """From the depth camera's plane to the face's front (the head frame's origin)."""
    yaw: float = 0.0
    """Degrees about the vertical; positive turns the face toward +x (the image's right)."""
    pitch: float = 0.0
    """Degrees; positive lifts the face."""
    roll: float = 0.0
    """Degrees; positive tips the head clockwise in the image."""
    offset_mm: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the head frame's origin from the depth camera's axis."""
    skin_gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Factors on the head's linear RGB: darker or tinted skin."""
    shoulders: bool = True
    scale: float = 1.0
    glasses: bool = False
    hand: bool = False
    """A hand before chin and cheek."""
    hair: bool = False
    """Dark hair with a fringe and locks before the ears; less than half of it gives a depth."""
    beard: bool = False

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(3, 3), from the head frame to the depth camera's."""
        # Yaw about y, pitch about x, roll about z, signs as above.
        turn: NDArray[np.float64] = Rotation.from_euler(
            "ZYX", [self.roll, -self.yaw, -self.pitch], degrees=True).as_matrix()
        return turn

    @property
    def shift(self) -> NDArray[np.float64]:
        """(3,) mm, the head frame's origin in the depth camera's frame."""
        return np.array([*self.offset_mm, self.distance_mm])


@dataclass(frozen=True)
class Light:
    """One distant lamp and what comes from everywhere."""

    toward: tuple[float, float, float] = (0.25, -0.45, -1.0)
    """Direction from the scene to the lamp, camera frame (any length)."""
    intensity: float = 0.75
    ambient: float = 0.35


@dataclass(frozen=True)
class Scene:
    """People, what is behind them, and the light."""

    people: tuple[Person, ...] = (Person(),)
    wall_mm: float | None = None
    """Distance of one flat wall; None for a room with furniture, its far wall at about 3 m."""
    wall_color: tuple[int, int, int] = (196, 190, 178)
    """The one wall's paint, RGB (sRGB), 0-255."""
    light: Light = Light()
    holes: float = 0.25
    """How much of the face gives no depth: 0 nothing, 0.25 traces at eyes and nostrils,
    1 large patches of hair, brows, cheeks and forehead as well."""
    decor: int = 0
    """Seed of the walls' pattern."""

    @property
    def target(self) -> int:
        """Index of the nearest person, whose face is wanted; -1 where there is nobody."""
        distances = [person.distance_mm for person in self.people]
        return distances.index(min(distances)) if distances else -1
