"""Which passes of which cascades look for a face, and in which order."""

from denseface.recon.detection._cascades import CascadePass

FRONTAL, PROFILE = "haarcascade_frontalface_alt2", "haarcascade_profileface"
"""Cascades that OpenCV ships (Viola and Jones, 2001, doi:10.1109/CVPR.2001.990517)."""

STRAIGHT = CascadePass(FRONTAL, 36.0, 1.1, 3)
"""At two fifths of a Kinect's resolution for a face at 0.8 m."""
FINE = CascadePass(FRONTAL, 48.0, 1.1, 3)
"""At half of it."""
TIPPED = tuple(CascadePass(FRONTAL, 36.0, 1.15, 3, roll=degrees) for degrees in (-25.0, 25.0))
"""For tipped heads."""
PROFILES = tuple(CascadePass(PROFILE, 34.0, 1.05, 3, mirrored=way) for way in (False, True))
"""For turned heads, either way."""
WHOLE_IMAGE, WHOLE_SHRINK = CascadePass(FRONTAL, 28.0, 1.2, 3), 4.0
"""Where no pass saw anything, to name what looks like a face where depth allows none; and how much
the image is shrunk for it."""

Rung = tuple[CascadePass, ...]
"""Passes that run together: the box that stands for most windows is the face's. The profile that
looks the other way puts its box up to 55 mm off."""
_TIPPED: tuple[Rung, ...] = tuple((one,) for one in TIPPED)

RUNGS: tuple[Rung, ...] = ((STRAIGHT,), *_TIPPED, PROFILES, (FINE,))
"""Until depth confirms a face. `STRAIGHT` finds most, the others what is tipped, turned or lit from
the side."""
EQUALIZED_RUNGS: tuple[Rung, ...] = ((FINE,), *_TIPPED)
"""Then, in equalised images, for faces in the dark, before a bright wall or lit aslant. The profile
cascade takes the back of an ear for a face there."""
LIFTED_RUNGS: tuple[Rung, ...] = tuple(
    (CascadePass(FRONTAL, 44.0, 1.04, 5, roll=degrees),)
    for degrees in (0.0, -15.0, 15.0, -33.0, 33.0))
"""Last, with the shadows lifted, in more sizes and angles: for what is lit from the side, tipped
far or both. Of 30 such faces of the choosing heads that the others miss they find 19, 17 in the
image as it was taken. With three windows instead of five they find 27, but a face on one of twelve
real tables, too."""
NEARER_RUNGS: tuple[Rung, ...] = ((FINE,), *_TIPPED, PROFILES)
"""For what stands before a face that was found; then `EQUALIZED_RUNGS`."""
