"""What a face refuses to be made of, and its report as JSON."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from denseface.recon.face import FaceCandidate, PointCloud, Report
from denseface.recon.settings import Settings
from tests.unit.service.faces import small_face


def cloud(**changes):
    good = {"points": np.zeros((5, 3), np.float32), "colors": np.zeros((5, 3), np.uint8)}
    return PointCloud(**good | changes)


def test_a_cloud_is_as_long_as_it_has_points():
    assert len(cloud()) == 5
    face = small_face()
    assert len(face.dense) == len(face.dense.points) == face.report.dense_points


def test_a_finite_cloud_may_be_as_far_away_as_it_likes():
    assert len(cloud(points=np.full((5, 3), 3e38, np.float32))) == 5


@pytest.mark.parametrize(("change", "message"), [
    ({"points": np.zeros((5, 3))}, r"points must be float32 \(5, 3\), found float64"),
    ({"points": np.zeros((5, 2), np.float32)}, r"points must be float32 \(5, 3\), found .*\(5, 2"),
    ({"points": np.full((5, 3), np.nan, np.float32)}, "points must be finite"),
    ({"points": np.full((5, 3), np.inf, np.float32)}, "points must be finite"),
    # A signalling NaN.
    ({"points": np.full((5, 3), 0x7FA00000, np.uint32).view(np.float32)}, "points must be finite"),
    ({"points": np.array([[1e30, -np.inf, 0]] * 5, np.float32)}, "points must be finite"),
    ({"colors": np.zeros((4, 3), np.uint8)}, r"colors must be uint8 \(5, 3\), found .*\(4, 3\)"),
    ({"colors": np.zeros((5, 3), np.int32)}, "colors must be uint8 .* found int32"),
])
def test_a_bad_cloud_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        cloud(**change)


def test_what_is_huge_is_finite_still():
    assert cloud(points=np.full((5, 3), 3e38, np.float32)).points.max() == np.float32(3e38)


@pytest.mark.parametrize(("change", "message"), [
    ({"normals": np.zeros((2, 3), np.float32)}, "normals must be float32"),
    ({"sigma": np.ones(2, np.float32)}, "sigma must be float32"),
    ({"cells": np.zeros((2, 2), np.int32)}, "cells must be int32"),
    ({"grid_shape": (3, 3)}, "cells must lie on the"),
])
def test_a_bad_dense_cloud_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(small_face().dense, **change)


@pytest.mark.parametrize(("wrong", "message"), [
    (np.nan, "sigma must be finite"), (np.inf, "sigma must be finite"),
    (0.0, "sigma must be positive"), (-0.5, "sigma must be positive")])
def test_a_standard_error_that_says_nothing_is_refused(wrong, message):
    dense = small_face().dense
    sigma = dense.sigma.copy()
    sigma[3] = wrong
    with pytest.raises(ValueError, match=message):
        replace(dense, sigma=sigma)


def test_cells_before_the_grid_are_refused():
    dense = small_face().dense
    cells = dense.cells.copy()
    cells[0, 0] = -1
    with pytest.raises(ValueError, match="cells must lie on the"):
        replace(dense, cells=cells)


def report(**changes):
    candidate = FaceCandidate(box=(1, 2, 3, 3), depth_mm=None, width_mm=None, verdict="no depth")
    return Report(**{
        "capture_id": "c", "face_box": (1, 2, 3, 3), "candidates": (candidate,),
        "initial_points": 10, "dense_points": 100, "mean_spacing_mm": 1.2, "r0_mm": 9.6,
        "noise_mm": 1.0, "timings_ms": {"total": 3.0}, "settings": Settings.of("paper", ratio=5),
        "calibration": "made up", "skew_us": -3, "version": "0", "warnings": ("dim",)} | changes)


def test_the_report_survives_json():
    assert Report.model_validate_json(report().model_dump_json()) == report()


def test_the_report_holds_no_nan():
    with pytest.raises(ValidationError, match="finite"):
        report(noise_mm=float("nan"))


def test_the_report_does_not_change():
    with pytest.raises(ValidationError, match="frozen"):
        report().capture_id = "other"
