"""Which of several frames is the best, by what the gate measures."""

from typing import NamedTuple

from denseface.recon.quality import FaceQuality, Quality
from denseface.service.gate.faults import Fault
from denseface.service.gate.judging import faults_of
from denseface.service.gate.thresholds import Thresholds

__all__ = ["Score", "score_of", "surely_good"]

_SEVERITY = {
    Fault.MOVE_BACK: 4,
    Fault.LOOK_HERE: 3, Fault.HOLD_STILL: 3,
    Fault.UNCOVER: 2, Fault.COME_CLOSER: 2,
    Fault.ONE_PERSON: 1, Fault.MORE_LIGHT: 1, Fault.LESS_LIGHT: 1,
    Fault.MOVE_LEFT: 1, Fault.MOVE_RIGHT: 1, Fault.MOVE_UP: 1, Fault.MOVE_DOWN: 1,
}
"""By what each costs the face (decision 0032): readings that are missing, then parts out of sight
or smeared, then a larger error, then colours alone or nothing yet. They add up."""
_NO_FACE = 100
"""Severity of a frame that shows somebody and no face: worse than all faults of one that does."""
_UNKNOWN = 0.5
"""Share of its limit that a measure counts as where it was not measured."""
_STILL_MM = 1.0
"""Of a person who stands still less is measured in a thirtieth of a second: a quarter of what is
wrong."""
_SHARP = 0.8
"""By the best of the last seconds; the limit is at 0.5."""
_WELL_WITHIN = 0.67
"""Share of their limits that turn, tilt and the way off the middle stay below."""


class Score(NamedTuple):
    """The smaller the better; by severity first."""

    severity: int
    """Of what is wrong with the frame, all together."""
    deviation: float
    """How far it is from an ideal frame: motion and blur count twice, turn, tilt and the way off
    the middle once, each as a share of its limit."""

    @property
    def with_face(self) -> bool:
        """Whether a face was seen."""
        return self.severity < _NO_FACE


def score_of(quality: Quality, thresholds: Thresholds | None = None) -> Score | None:
    """Give a frame's score, whatever the frames before it were like.

    None where there can be no face of it: nobody is there, or so near that nothing is measured.
    """
    limits = thresholds or Thresholds()
    face = quality.face
    if face is None:
        nothing = quality.too_near or not quality.somebody
        return None if nothing else Score(_NO_FACE, 0.0)
    severity = sum(_SEVERITY[fault] for fault in faults_of(quality, limits))
    blur = 0.0 if face.sharpness is None else 1.0 - face.sharpness
    return Score(severity, round(
        2 * _share(face.motion_mm, limits.motion_mm.wrong) + 2 * blur
        + sum(_asides(face, limits)), 6))


def surely_good(quality: Quality, thresholds: Thresholds | None = None) -> bool:
    """Whether no later frame can be worth waiting for: nothing is wrong, by a margin, and still."""
    limits = thresholds or Thresholds()
    face = quality.face
    return (
        face is not None and not faults_of(quality, limits)
        and face.motion_mm is not None and face.motion_mm <= _STILL_MM
        and (face.sharpness is None or face.sharpness >= _SHARP)
        and max(_asides(face, limits)) <= _WELL_WITHIN)


def _asides(face: FaceQuality, limits: Thresholds) -> tuple[float, float, float]:
    off = max(abs(face.off_center[0]), abs(face.off_center[1]))
    return (_share(face.turn_deg, limits.turn_deg.wrong),
            _share(face.tilt_deg, limits.tilt_deg.wrong), off / limits.off_center.wrong)


def _share(value: float | None, limit: float) -> float:
    return _UNKNOWN if value is None else abs(value) / limit
