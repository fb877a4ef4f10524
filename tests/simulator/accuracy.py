"""How near a reconstructed face is to the true one."""

import itertools
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from denseface.capture.frame import RgbdFrame
from denseface.recon.face import Face
from denseface.service.tools.evaluation.paper import Errors, per_mm
from tests.simulator.labels import Label
from tests.simulator.truth import Truth

__all__ = ["NEAR_MM", "Accuracy", "measure"]

NEAR_MM = 2.0

# A point this far off the head's surface is not its rim but on something else.
_ELSEWHERE_MM = 10.0
# On a hand, a frame of glasses or cloth that touches the face, a point is when it is this far off
# the head and nearer to that thing.
_OFF_MM = 3.0
_THINGS = (Label.BODY, Label.HAND, Label.GLASSES)
# A reading of the face's pixel that differs more is not of the face.
_READING_MM = 15.0


@dataclass(frozen=True)
class Accuracy:
    """Figures of one face against its truth; distances from points to the head's true surface."""

    initial_points: int
    dense_points: int
    mean_mm: float
    """Mean error of the dense cloud."""
    sd_mm: float
    raw_mean_mm: float
    """Mean error of the initial cloud: the sensor's own."""
    gross: float
    """Share of the dense cloud with an error above 5.5 mm."""
    covered: float
    """Share of the true visible face that has a dense point within 2 mm."""
    lost: float
    """Share of the sensor's readings of the true face that are not in the initial cloud."""
    elsewhere: float
    """Share of the dense cloud on walls, shoulders, other people, a hand, or glasses."""
    per_mm: NDArray[np.float64] = field(compare=False, repr=False)
    """(55,) share of the dense cloud per mm of error, between `ERROR_BINS_MM`."""

    @property
    def ratio(self) -> float:
        """Dense points for each initial one."""
        return self.dense_points / self.initial_points


def measure(face: Face, truth: Truth, frame: RgbdFrame) -> Accuracy:
    """Compare a face with the true surface that its frame shows."""
    errors = truth.surface_distance(face.dense.points)
    nearest, _ = cKDTree(face.dense.points).query(
        truth.face_points(), distance_upper_bound=NEAR_MM)
    figures = Errors.of(errors)
    return Accuracy(
        initial_points=len(face.initial),
        dense_points=len(face.dense),
        mean_mm=figures.mean_mm,
        sd_mm=figures.sd_mm,
        raw_mean_mm=float(truth.surface_distance(face.initial.points).mean()),
        gross=figures.gross,
        covered=float(np.isfinite(nearest).mean()),
        lost=_lost(face, truth, frame),
        elsewhere=_elsewhere(face.dense.points, errors, truth),
        per_mm=per_mm(errors),
    )


def _elsewhere(
    points: NDArray[np.float32], errors: NDArray[np.float64], truth: Truth
) -> float:
    off = ~np.isin(truth.labels_at(points), (Label.FACE, Label.HEAD)) & (errors > _OFF_MM)
    off[off] = (errors[off] > _ELSEWHERE_MM) | (
        truth.surface_distance(points[off], _THINGS) < errors[off])
    return float(off.mean())


def _lost(face: Face, truth: Truth, frame: RgbdFrame) -> float:
    readings = frame.depth > 0
    z = frame.depth[readings] * (frame.depth_meaning.unit_um / 1000)
    points = np.concatenate([frame.depth_camera.rays()[readings] * z[:, None], z[:, None]], axis=1)
    with np.errstate(invalid="ignore"):
        of_face = (truth.labels_at(points) == Label.FACE) & (
            np.abs(truth.depth_error(points)) < _READING_MM)
    kept = np.zeros(readings.shape, bool)
    row_column = frame.depth_camera.project(face.initial.points)[:, ::-1]
    # A point may be the mean of a square of readings: `Settings.pixel_mm`.
    side = max(1, round(face.report.mean_spacing_mm * frame.depth_camera.fx
                        / float(np.median(face.initial.points[:, 2]))))
    for place in itertools.product(range(side), repeat=2):
        row, column = np.rint(row_column + np.array(place) - (side - 1) / 2).astype(np.int64).T
        kept[row, column] = True
    return float((~kept[readings][of_face]).mean())
