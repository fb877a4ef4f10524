"""A face's lengths and their 95 % intervals."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from denseface.arguments import expect
from denseface.recon.face import DenseCloud, Face
from denseface.recon.measurement._face_map import FaceMap, head_frame
from denseface.recon.measurement._landmarks import Landmarks, find_landmarks

__all__ = ["Length", "Measurements", "measure", "raw_lengths"]

_NORMAL_95 = 1.96
"""Half of the interval that holds 95 of 100 draws of a normal distribution, standard deviations."""
_AROUND_MM = 3
"""An end's sigma is the mean over so much around it, mm."""


@dataclass(frozen=True)
class Length:
    """A length and the interval that holds the true one in 95 of 100 faces, mm."""

    value_mm: float
    low_mm: float
    high_mm: float


@dataclass(frozen=True)
class Measurements:
    """What is measured on a face; None where an end of it was not found.

    Attributes
    ----------
    face_width : breadth of the face 50 mm behind the sellion, between the levels of sellion and
        subnasale; near the bizygomatic breadth (zy-zy)
    face_length : sellion to gnathion, the morphological height of the face (n-gn)
    nose_width : between the grooves where the wings of the nose meet the cheeks (ac-ac)
    nose_length : sellion to subnasale, the height of the nose (n-sn)
    """

    face_width: Length | None = None
    face_length: Length | None = None
    nose_width: Length | None = None
    nose_length: Length | None = None


class Raw(NamedTuple):
    """A length as the landmarks give it, and its ends' standard error, mm."""

    value: float
    sigma: float


class _Error(NamedTuple):
    """What is known of a length's error, by `bench/measurement.py --fit`.

    The interval is value - offset, +- 1.96 root(place^2 + (gain sigma)^2).
    """

    offset: float
    """mm, of what the landmarks give, over the true length."""
    place: float
    """mm, standard deviation of finding the ends on a surface without error."""
    gain: float
    """Of the ends' standard error."""
    least: float
    """mm: shorter is no face's."""
    most: float
    """mm: longer is no face's."""


_ERRORS = {
    "face_width": _Error(-0.42, 1.95, 0.25, 90.0, 190.0),
    "face_length": _Error(-0.87, 0.35, 2.0, 70.0, 160.0),
    "nose_width": _Error(1.70, 2.13, 1.25, 22.0, 70.0),
    "nose_length": _Error(-0.57, 1.90, 1.0, 28.0, 80.0),
}


def measure(face: Face) -> Measurements:
    """Measure a face.

    Pose does not matter: all ends are found in the head's own frame. What is not found, or has no
    face's size, is None; all of it where the face's plane of symmetry is not found.
    """
    expect("face", face, Face)
    raw = raw_lengths(face.dense)
    found = {}
    for name, one in raw.items():
        error = _ERRORS[name]
        value = one.value - error.offset
        if error.least <= value <= error.most:
            half = _NORMAL_95 * float(np.hypot(error.place, error.gain * one.sigma))
            found[name] = Length(value, value - half, value + half)
    return Measurements(**found)


def raw_lengths(cloud: DenseCloud) -> dict[str, Raw]:
    """Give what the landmarks of a cloud give, without corrections: names are `_ERRORS`'."""
    frame = head_frame(cloud) if len(cloud) else None
    if frame is None:
        return {}
    face = FaceMap.of(cloud, frame)
    marks = find_landmarks(face)
    return {} if marks is None else _lengths(face, marks)


def _lengths(face: FaceMap, marks: Landmarks) -> dict[str, Raw]:
    def between(a: tuple[float, float], b: tuple[float, float]) -> Raw:
        return Raw(float(np.hypot(*np.subtract(a, b))),
                   float(np.hypot(_sigma(face, 0.0, a[0]), _sigma(face, 0.0, b[0]))))

    def across(width: float) -> Raw:
        level = (marks.sellion[0] + marks.subnasale[0]) / 2
        left, right = (_sigma(face, side * width / 2, level) for side in (-1, 1))
        return Raw(width, float(np.hypot(left, right)))

    found = {"nose_length": between(marks.sellion, marks.subnasale)}
    if marks.gnathion is not None:
        found["face_length"] = between(marks.sellion, marks.gnathion)
    if marks.face_width is not None:
        found["face_width"] = across(marks.face_width)
    if marks.grooves is not None:
        found["nose_width"] = across(marks.grooves)
    return found


def _sigma(face: FaceMap, x: float, y: float) -> float:
    """Give the standard error around a place, mm; of the nearest places where it is empty."""
    row, column = (int(np.abs(face.at - at).argmin()) for at in (y, x))
    for reach in (_AROUND_MM, 4 * _AROUND_MM, len(face.at)):
        near = face.sigma[max(row - reach, 0):row + reach + 1,
                          max(column - reach, 0):column + reach + 1]
        if np.isfinite(near).any():
            return float(np.nanmean(near))
    return 0.0
