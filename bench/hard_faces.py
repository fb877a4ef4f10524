"""Faces in hard scenes: other proportions, children, turned, far, large holes, other sensors."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bench.heads import at_hand
from bench.recall_scenes import View
from tests.simulator import Deformed, Person, Scene
from tests.simulator.sensors import SENSORS

__all__ = ["hard_views", "sensor_views", "turned_views"]

_YAW, _PITCH, _ROLL = 60.0, 30.0, 40.0
"""How far heads are turned at most, degrees."""
_CHILD = (0.7, 0.85)
"""Scales of children's heads."""
_YAWS = (-66.0, -60.0, -52.0, -45.0, 45.0, 52.0, 60.0, 66.0)
"""Of those that are turned far; the recall table goes to 60."""
_WORN = ("nothing", "hair", "beard", "glasses", "hair and beard", "a child")


def hard_views(heads: tuple[str, ...], count: int) -> Iterator[View]:
    """Give so many scenes; the same number gives the same one."""
    names = at_hand(heads)
    for number in range(count):
        rng = np.random.default_rng([15, len(heads), number])
        head = names[number % len(names)]
        match number % 3:
            case 0:
                head += f"~{number}"
            case 1:
                head += f"+{rng.choice(list(Deformed))}"
        far = rng.random() < 0.2
        person = Person(
            head, float(rng.uniform(1300, 1700) if far else rng.uniform(500, 1300)),
            offset_mm=(float(rng.uniform(-90, 90)), float(rng.uniform(-50, 50))),
            glasses=bool(rng.random() < 0.15), hand=bool(rng.random() < 0.15),
            scale=float(rng.uniform(*_CHILD)) if rng.random() < 0.25 else 1.0)
        person = _turned(person, number, rng)
        wall = person.distance_mm + float(rng.uniform(150, 900))
        scene = Scene((person,), holes=float(rng.choice([0.0, 0.25, 0.25, 0.6, 1.0])),
                      decor=number, wall_mm=wall if rng.random() < 0.4 else None)
        yield View("hard", f"{number}", scene, number)


def turned_views(heads: tuple[str, ...]) -> Iterator[View]:
    """Give heads that are turned far, with hair, beard, glasses, or as children."""
    names = at_hand(heads)
    for number, yaw in enumerate(_YAWS):
        for which, head in enumerate(names):
            seed = 10 * number + which
            rng = np.random.default_rng([17, len(heads), seed])
            worn = _WORN[(number + 2 * which) % len(_WORN)]
            person = Person(
                head, float(rng.uniform(600, 1050)), yaw=yaw,
                offset_mm=(float(rng.uniform(-70, 70)), float(rng.uniform(-40, 40))),
                hair="hair" in worn, beard="beard" in worn, glasses=worn == "glasses",
                scale=_CHILD[1] if worn == "a child" else 1.0)
            yield View("turned far", worn, Scene((person,), decor=seed), seed)


def sensor_views(heads: tuple[str, ...]) -> Iterator[View]:
    """Give two heads to every sensor of the simulator, straight or turned by up to 60 degrees."""
    names = at_hand(heads)
    for number, sensor in enumerate(SENSORS.values()):
        for which, head in [*enumerate(names + names)][number % len(names):][:2]:
            seed = 10 * number + which
            rng = np.random.default_rng([18, len(heads), seed])
            yaw = float(rng.uniform(-_YAW, _YAW)) if (number + which) % 3 else 0.0
            person = Person(head, float(rng.uniform(600, 1100)), yaw=yaw,
                            hair=seed % 4 == 1, beard=seed % 5 == 2)
            yield View("sensor", sensor.name, Scene((person,), decor=seed), seed, sensor=sensor)


def _turned(person: Person, number: int, rng: np.random.Generator) -> Person:
    """Turn a head in one way or in all, or leave it."""
    yaw, pitch, roll = (float(rng.uniform(-most, most)) for most in (_YAW, _PITCH, _ROLL))
    match number % 8:
        case 1 | 2:
            return replace(person, yaw=yaw)
        case 3:
            return replace(person, pitch=pitch)
        case 4:
            return replace(person, roll=roll)
        case 5:
            return replace(person, yaw=0.75 * yaw, pitch=0.6 * pitch, roll=0.5 * roll)
    return person
