"""What every kind of sensor looks at: the same heads, at the same distances."""

from collections.abc import Iterator

import numpy as np

from bench.heads import at_hand
from denseface.recon import ReconstructionError
from tests.simulator import Person, Scene

__all__ = ["DISTANCES_MM", "left_out", "scenes"]

DISTANCES_MM = (650.0, 800.0, 1000.0)
_YAW, _PITCH = 18.0, 6.0
"""Largest turns, degrees."""
_HOLES = (0.25, 1.0)
"""`Scene.holes` by turns."""


def scenes(
    heads: tuple[str, ...], distances_mm: tuple[float, ...] = DISTANCES_MM
) -> Iterator[tuple[Scene, int]]:
    """Give scenes and the seeds to simulate them with.

    Parameters
    ----------
    heads : names of heads, as in `bench.heads`
    distances_mm : some of `DISTANCES_MM`; a scene is the same whichever others are asked for
    """
    for i, head in enumerate(at_hand(heads)):
        for distance in distances_mm:
            j = DISTANCES_MM.index(distance)
            rng = np.random.default_rng([11, i, j])
            person = Person(head, distance, yaw=rng.uniform(-_YAW, _YAW),
                            pitch=rng.uniform(-_PITCH, _PITCH))
            yield (Scene((person,), holes=_HOLES[(i + j) % 2], decor=10 * i + j),
                   5000 + 10 * i + j)


def left_out(scene: Scene, sensor: str, why: ReconstructionError) -> str:
    """Say that no face came of a scene."""
    person = scene.people[0]
    return f"{sensor}, {person.head} at {person.distance_mm:.0f} mm is left out: {why}"
