"""Lengths of simulated faces, whose true lengths are those of their meshes."""

from dataclasses import fields, replace

import numpy as np
import pytest

from bench.measurement import NAMES, samples
from denseface.recon.measurement import Measurements, measure


@pytest.fixture(scope="module")
def taken():
    """Frames of heads that are made by code alone, near and far, turned and tilted."""
    return list(samples(["procedural~21", "procedural~23"], 4, 5))


def test_intervals_hold_the_true_lengths(taken):
    held = [length.low_mm <= sample.true[name] <= length.high_mm
            for sample in taken for name in NAMES
            if (length := getattr(sample.measured, name)) is not None]
    assert len({sample.true["nose_width"] for sample in taken}) == 2, "two heads"
    assert len(held) > 0.7 * len(NAMES) * len(taken)
    assert np.mean(held) > 0.75, "95 of 100 hold; of so few, some more may miss"


def test_intervals_say_something(taken):
    for sample in taken:
        for field in fields(Measurements):
            length = getattr(sample.measured, field.name)
            if length is not None:
                assert length.low_mm < length.value_mm < length.high_mm
                assert length.high_mm - length.low_mm < 0.5 * length.value_mm


def test_what_is_no_face_has_no_lengths(face):
    few = np.flatnonzero(face.dense.cells[:, 0] < 40)
    for kept in (few, few[:0]):
        parts = {name: getattr(face.dense, name)[kept]
                 for name in ("points", "colors", "normals", "sigma", "cells")}
        assert measure(replace(face, dense=replace(face.dense, **parts))) == Measurements()
