"""The model that is shipped: small, whole, and with its licence."""

from pathlib import Path

import numpy as np
import pytest

from denseface.recon import prior
from denseface.recon.prior import basis

ROOM = Path(prior.__file__).parent


def test_it_is_small_and_has_its_licence_beside_it():
    assert (ROOM / "basis.npz").stat().st_size < 1_000_000
    licence = (ROOM / "LICENSE-ICT-FaceKit.txt").read_text()
    assert licence.startswith("MIT License")
    assert "USC Institute for Creative Technologies" in licence


def test_its_arrays_fit_together_and_cannot_be_changed():
    model = basis()
    points, modes = len(model.vertices), model.modes.shape[2]
    assert model.modes.shape == (points, 3, modes)
    assert np.unique(model.triangles).tolist() == list(range(points))
    np.testing.assert_allclose(np.linalg.norm(model.normals, axis=1), 1, rtol=1e-5)
    with pytest.raises(ValueError, match="read-only"):
        model.modes[0] = 0


def test_it_is_a_face():
    model = basis()
    width, height, depth = np.ptp(model.vertices, axis=0)
    assert 130 < width < 170
    assert 180 < height < 220
    assert 80 < depth < 120
    nose = model.vertices[model.vertices[:, 2].argmin()]
    assert abs(nose[0]) < 3
    assert abs(nose[1]) < 15


def test_its_first_modes_say_most():
    lengths = np.sqrt((basis().modes ** 2).sum(axis=1).mean(axis=0))
    assert (np.diff(lengths) < 0.01).all()
    assert lengths[0] > 4
    assert basis().missing_mm < 0.5


def test_its_first_points_are_spread():
    first = basis().vertices[:250]
    away = np.linalg.norm(first[:, None] - first, axis=2) + 1e3 * np.eye(len(first))
    assert away.min() > 5
