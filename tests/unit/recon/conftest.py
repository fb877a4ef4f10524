"""Simulated frames, rendered once: each takes a second or more."""

import pytest

from denseface.recon import reconstruct
from tests.simulator import Person, Scene, simulate


@pytest.fixture(scope="session")
def shot():
    """A head before a room, its frame and the truth."""
    return simulate(Scene((Person(distance_mm=700),)), seed=1)[0]


@pytest.fixture(scope="session")
def face(shot):
    """The `best` face of `shot`."""
    return reconstruct(shot.frame)
