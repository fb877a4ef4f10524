"""Scenes of one head, each rendered once, and what the gate measures of them."""

from dataclasses import replace
from functools import cache

import pytest

from denseface.capture.frame import RgbdFrame
from denseface.recon.quality import Quality, measure
from tests.simulator import Person, Scene, simulate

PERIOD_US = 100_000
"""Between two measurements."""


@cache
def framed(**person) -> RgbdFrame:
    """The frame of a scene with one person."""
    return simulate(Scene((Person(**{"distance_mm": 750.0} | person),)), seed=1)[0].frame


def stream(*frames: RgbdFrame) -> Quality:
    """Measure frames that were taken one after the other."""
    quality = None
    for index, frame in enumerate(frames):
        quality = measure(replace(frame, depth_timestamp_us=1 + index * PERIOD_US), quality)
    assert quality is not None
    return quality


@pytest.fixture(scope="session")
def ahead():
    """Somebody in the middle who looks at the camera."""
    return framed()
