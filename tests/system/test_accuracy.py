"""Faces of the recordings against the true surface; `python -m bench.accuracy` prints the figures.

The bounds lie 5-8 % outside what is reached today, so that a step back shows. The goal is a mean
error of at most 0.6 mm and 96 % of the visible face within 2 mm of a point at 0.7-0.8 m.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import pytest

from denseface.capture.burst import fuse
from denseface.capture.frame import RgbdFrame
from denseface.recon import Face, NoFaceError, Preset, Settings, reconstruct
from denseface.service.export.mesh import triangulate
from tests.mesh_holes import MeshFaults, mesh_faults
from tests.simulator import Accuracy, Truth, measure
from tests.virtual_sensor.fixtures import FOLDER
from tests.virtual_sensor.process import play

# Most mean error, mm, and least share of the face within 2 mm, of the `best` preset.
BOUNDS = {
    "dark_skin": (0.65, 0.915),
    "face_fills_box": (0.54, 0.945),
    "far_1000": (0.80, 0.880),
    "frontal_700": (0.61, 0.940),
    "many_holes": (0.70, 0.930),
    "side_light": (0.60, 0.940),
    "turned_18": (0.65, 0.950),
    "two_people": (0.61, 0.940),
    "wall_close": (0.56, 0.945),
}
# As reported for the method on real sensors.
PAPER_MEAN_MM = 1.31


@dataclass
class Taken:
    """The frames of a recording, and the faces of the first one, each reconstructed once."""

    name: str
    frames: list[RgbdFrame]
    truth: Truth

    @property
    def frame(self) -> RgbdFrame:
        return self.frames[0]

    @cached_property
    def faces(self) -> dict[Preset, Face]:
        return {preset: reconstruct(self.frame, Settings(preset=preset)) for preset in Preset}

    @cached_property
    def accuracy(self) -> dict[Preset, Accuracy]:
        return {preset: measure(face, self.truth, self.frame)
                for preset, face in self.faces.items()}

    @property
    def best(self) -> Accuracy:
        return self.accuracy[Preset.BEST]


@cache
def take(name: str) -> Taken:
    frames, _ = play(FOLDER / f"{name}.oni", max_frames=3)
    return Taken(name, frames, Truth.load(FOLDER / f"{name}.truth.npz"))


@pytest.fixture(scope="module", params=list(BOUNDS))
def taken(request):
    return take(request.param)


def test_every_recording_with_a_truth_is_measured():
    assert sorted(BOUNDS) == sorted(
        path.name.removesuffix(".truth.npz") for path in FOLDER.glob("*.truth.npz"))


def test_the_mean_error_is_small_and_below_the_sensors_own(taken):
    most, _ = BOUNDS[taken.name]
    assert taken.best.mean_mm <= most
    for found in taken.accuracy.values():
        assert found.mean_mm < found.raw_mean_mm


def test_the_face_is_covered(taken):
    _, least = BOUNDS[taken.name]
    assert taken.best.covered >= least


def test_hardly_a_point_is_far_off(taken):
    for found in taken.accuracy.values():
        assert found.gross <= 0.003


def test_nothing_of_the_face_is_cut_off_and_nothing_else_kept(taken):
    for preset, found in taken.accuracy.items():
        # Of a larger pixel, most must be read.
        assert found.lost <= (0.04 if preset is Preset.LIGHT else 0.02)
        assert found.elsewhere == 0


def test_the_mesh_is_whole(taken):
    """No hole within the outline, though a nose hides what is beside it: none is said, either."""
    face = taken.faces[Preset.BEST]
    assert mesh_faults(face.dense.points, triangulate(face.dense)) == MeshFaults(0, 0, 0, 0)
    assert not any("left open" in warning for warning in face.report.warnings)


def test_about_ten_points_for_each_seed(taken):
    for found in taken.accuracy.values():
        assert 8 <= found.ratio <= 11


def test_each_preset_is_better_than_the_one_before(taken):
    paper, faithful, light, best = (taken.accuracy[preset].mean_mm for preset in Preset)
    assert best < faithful < paper < PAPER_MEAN_MM
    # Larger pixels carry less noise and less detail.
    assert light < min(1.12 * best, faithful)


@pytest.mark.parametrize("taken", ["two_people"], indirect=True)
def test_the_nearer_of_two_people_is_chosen(taken):
    chosen, *others = taken.faces[Preset.BEST].report.candidates
    assert chosen.verdict == "chosen"
    assert 700 < chosen.depth_mm < 850
    assert others == []  # nothing behind it is looked at
    assert taken.faces[Preset.BEST].dense.points[:, 2].max() < 1000


def test_nobody_is_found_in_an_empty_room():
    (frame,), _ = play(FOLDER / "empty_room.oni", max_frames=1)
    with pytest.raises(NoFaceError, match="no face found"):
        reconstruct(frame)


def test_three_frames_are_more_accurate_than_one():
    """By recording, the goal is 0.88 of the error of one."""
    ratios = []
    for taken in map(take, BOUNDS):
        three = reconstruct(fuse(taken.frames))
        error = taken.truth.surface_distance(three.dense.points).mean()
        ratios.append(error / taken.best.mean_mm)
    assert sum(ratios) / len(ratios) <= 0.88, ratios
    assert max(ratios) <= 0.9, ratios
