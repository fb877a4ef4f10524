import numpy as np
import pytest

from bench.colors import PARTS, Compared
from denseface.recon import reconstruct
from tests.simulator import KINECT_DEFAULT, Person, Scene, TrueColors, simulate

SKIN, GREEN, HAIR = (200, 150, 120), (30, 220, 40), (50, 40, 30)


@pytest.fixture(scope="module")
def scene():
    return Scene((Person(distance_mm=700),))


@pytest.fixture(scope="module")
def face(scene):
    return reconstruct(simulate(scene, seed=1)[0].frame)


@pytest.fixture(scope="module")
def compared(face, scene):
    return Compared.of(face, TrueColors.of(scene, KINECT_DEFAULT))


def test_a_faces_colours_are_near_the_true_ones(face, compared):
    errors = compared.errors(face.dense.colors)
    assert tuple(errors) == PARTS
    assert 1 < errors["all"] < 6
    # Colours of other points are not.
    shuffled = np.random.default_rng(0).permutation(face.dense.colors)
    assert compared.errors(shuffled)["all"] > 4 * errors["all"]


def test_parts_are_what_they_say(face, compared):
    share = {name: part.mean() for name, part in compared.parts.items()}
    assert share["all"] > 0.98
    assert 0.03 < share["rim"] < 0.25
    assert 0 <= share["inside holes"] < 0.05
    assert 0.1 < share[PARTS[3]] < 0.4
    off = np.abs(face.dense.points[:, 0] - face.dense.points[:, 0].mean())
    assert off[compared.parts["rim"]].mean() > 1.3 * off.mean()


def test_an_error_is_the_mean_over_channels():
    true = np.array([SKIN, SKIN], np.float32)
    parts = {"all": np.array([True, True]), "rim": np.array([False, True]),
             "inside holes": np.zeros(2, bool)}
    found = Compared(parts, true).errors(np.array([SKIN, (203, 150, 126)], np.uint8))
    assert found["all"] == pytest.approx(1.5)
    assert found["rim"] == pytest.approx(3)
    assert np.isnan(found["inside holes"])


def test_the_walls_share_is_told_from_a_wrong_brown():
    true = np.array([SKIN] * 4, np.float32)
    mixed = 0.7 * np.array(SKIN) + 0.3 * np.array(GREEN)
    colors = np.rint([SKIN, GREEN, mixed, HAIR]).astype(np.uint8)
    share = Compared({}, true).background(colors, np.array(GREEN))
    np.testing.assert_allclose(share, [0, 1, 0.3, 0], atol=0.06)
