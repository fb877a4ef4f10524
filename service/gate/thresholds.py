"""From where on a frame is not good enough; decision record 0032 says what each costs."""

from typing import NamedTuple

__all__ = ["Limit", "Thresholds"]


class Limit(NamedTuple):
    """A measure is wrong beyond `wrong`; once wrong, it is right again only short of `right`."""

    wrong: float
    right: float

    def above(self, value: float, *, held: bool) -> bool:
        """Whether a value is too large."""
        return value > (self.right if held else self.wrong)

    def below(self, value: float, *, held: bool) -> bool:
        """Whether a value is too small."""
        return value < (self.right if held else self.wrong)


class Thresholds(NamedTuple):
    """All limits; of one that must not be passed upwards `right` is the smaller, and so on."""

    nearest_mm: Limit = Limit(500.0, 520.0)
    """A Kinect measures nothing under about 450 mm, and the nose is nearer than the face."""
    farthest_mm: Limit = Limit(1200.0, 1160.0)
    """The error is 1.7 times that at 750 mm, and the rim of the face begins to be lost."""
    off_center: Limit = Limit(0.15, 0.12)
    """Share of the image's width and height: the face is whole in both images, with room to move
    before the frame is taken."""
    turn_deg: Limit = Limit(20.0, 17.0)
    """Farther, a tenth of the face is out of sight."""
    tilt_deg: Limit = Limit(20.0, 17.0)
    coverage: Limit = Limit(0.70, 0.73)
    """Share of the face that is measured: the error is 1.15 times that of a face without holes."""
    motion_mm: Limit = Limit(4.0, 3.0)
    """In a thirtieth of a second: a twentieth of the rim is lost, twice as fast the error grows."""
    sharpness: Limit = Limit(0.5, 0.6)
    """By the best of the last seconds: 3 mm on the face become one colour."""
    dark: Limit = Limit(0.5, 0.4)
    """Share of the face: shape is measured in any light, colours drown in noise."""
    burnt: Limit = Limit(0.3, 0.2)
    """Share of the face: its colours are lost; a shiny forehead has less."""
