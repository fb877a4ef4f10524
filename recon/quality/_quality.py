"""What is measured of a frame before it is taken.

The components are those of ISO/IEC 29794-5 (face image quality) that a depth sensor can measure in
millimetres and degrees, where a photograph has to guess.
"""

from dataclasses import dataclass, field
from enum import StrEnum

from denseface.recon.face import Box, FaceCandidate
from denseface.recon.quality._motion import Patch
from denseface.recon.quality._presence import SparseDepth

__all__ = ["FaceQuality", "Memory", "Quality", "Sight"]


class Sight(StrEnum):
    """By what a face was found."""

    AHEAD = "ahead"
    """A cascade for faces that look ahead, in the colour image or, without one, in shaded depth."""
    ASIDE = "aside"
    """A cascade for turned faces alone."""
    DEPTH = "depth"
    """The shape of its depth alone: the image shows no face there."""


@dataclass(frozen=True)
class FaceQuality:
    """The face that would be reconstructed: the nearest."""

    box: Box
    """x, y, width, height; pixels of the colour image (of the depth image without colour)."""
    sight: Sight
    distance_mm: float
    """Median z in the middle of the box."""
    off_center: tuple[float, float]
    """How far its middle is to the right of the image's middle and below it, by the image's width
    and height."""
    coverage: float
    """Share of the face's part of the depth image that was measured, 0 to 1."""
    turn_deg: float | None
    """How far the face looks to the right of the camera, as the camera sees it: toward the person's
    own left; None where too little of it was measured."""
    tilt_deg: float | None
    """How far it looks above the camera; None as above."""
    motion_mm: float | None
    """How far it moved in a thirtieth of a second; None where there is no frame to compare."""
    sharpness: float | None
    """By the best of the last seconds, 0 to 1; None without colour."""
    dark: float | None
    """Share of it that is too dark to tell a colour, 0 to 1; None without colour."""
    burnt: float | None
    """Share of it that is saturated, 0 to 1; None without colour."""


@dataclass(frozen=True, eq=False)
class Memory:
    """What the next measurement needs of those before."""

    count: int = 0
    """Measurements so far."""
    followed: FaceCandidate | None = None
    """The face to look for first."""
    missed: int = 0
    """How many measurements ago the colour image last showed it."""
    others: int = 0
    """Other faces in the last search of the whole image."""
    patch: Patch | None = None
    best_sharpness: float = 0.0
    vain: SparseDepth | None = None
    """The depth in which colour showed no face, when it last changed."""
    still: int = 0
    """For how many measurements it did not change."""


@dataclass(frozen=True, eq=False)
class Quality:
    """One frame, as the gate sees it."""

    timestamp_us: int
    """Of the depth image, sensor clock."""
    somebody: bool
    """Whether depth shows what may be a person, near enough."""
    too_near: bool = False
    """Whether a face is so near that nothing is measured on it."""
    faces: int = 0
    """How many people's faces are near enough."""
    face: FaceQuality | None = None
    """The nearest."""
    memory: Memory = field(default=Memory(), repr=False)
