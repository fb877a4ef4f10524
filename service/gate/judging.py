"""From a frame's quality to what is wrong with it."""

from collections.abc import Collection, Iterator

from denseface.recon.quality import FaceQuality, Quality, Sight
from denseface.service.gate.faults import Fault
from denseface.service.gate.thresholds import Thresholds

__all__ = ["faults_of"]


def faults_of(
    quality: Quality, thresholds: Thresholds, held: Collection[Fault] = ()
) -> tuple[Fault, ...]:
    """Give what is wrong with a frame, the most important first; nothing where it is good enough.

    Parameters
    ----------
    quality : as measured; what it does not know is not wrong
    thresholds : the limits
    held : what was wrong with the frame before: it takes more until that is right again
    """
    if quality.too_near:
        return (Fault.MOVE_BACK,)
    if not quality.somebody:
        return (Fault.NOBODY,)
    if quality.face is None:
        return (Fault.LOOK_HERE,)
    found = set(_of_place(quality.face, thresholds, held))
    if quality.faces > 1:
        found.add(Fault.ONE_PERSON)
    found.update(_of_face(quality.face, thresholds, held))
    return tuple(fault for fault in Fault if fault in found)


def _of_place(face: FaceQuality, limits: Thresholds, held: Collection[Fault]) -> Iterator[Fault]:
    """Say where the person should go."""
    if limits.nearest_mm.below(face.distance_mm, held=Fault.MOVE_BACK in held):
        yield Fault.MOVE_BACK
    elif limits.farthest_mm.above(face.distance_mm, held=Fault.COME_CLOSER in held):
        yield Fault.COME_CLOSER
    to_right, below = face.off_center
    # Who is too far to the image's left goes to its right: to the person's own left.
    for off, fault in ((-to_right, Fault.MOVE_LEFT), (to_right, Fault.MOVE_RIGHT),
                       (below, Fault.MOVE_UP), (-below, Fault.MOVE_DOWN)):
        if limits.off_center.above(off, held=fault in held):
            yield fault


def _of_face(face: FaceQuality, limits: Thresholds, held: Collection[Fault]) -> Iterator[Fault]:
    """Say what the face itself should do, or the light."""
    away = Fault.LOOK_HERE in held
    if (face.sight is not Sight.AHEAD
            or limits.turn_deg.above(abs(face.turn_deg or 0.0), held=away)
            or limits.tilt_deg.above(abs(face.tilt_deg or 0.0), held=away)):
        yield Fault.LOOK_HERE
    if limits.coverage.below(face.coverage, held=Fault.UNCOVER in held):
        yield Fault.UNCOVER
    if face.dark is not None and limits.dark.above(face.dark, held=Fault.MORE_LIGHT in held):
        yield Fault.MORE_LIGHT
    if face.burnt is not None and limits.burnt.above(face.burnt, held=Fault.LESS_LIGHT in held):
        yield Fault.LESS_LIGHT
    moving = Fault.HOLD_STILL in held
    moved, sharp = face.motion_mm, face.sharpness
    if (moved is not None and limits.motion_mm.above(moved, held=moving)) or (
            sharp is not None and limits.sharpness.below(sharp, held=moving)):
        yield Fault.HOLD_STILL
