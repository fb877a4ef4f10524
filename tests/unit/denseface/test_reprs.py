"""What a notebook shows of a thing: one short line."""

from dataclasses import replace

import numpy as np
import pytest

from denseface import (
    Calibration,
    Face,
    FrameOrigin,
    PublishedFace,
    PublishedFailure,
    PublishedHint,
    PublishedPreview,
    Status,
)
from denseface.recon.face import Seeds
from denseface.service.errors import CaptureFailedError
from denseface.short_repr import short_repr
from tests.unit.service.faces import small_face, small_frame

EPOCH, SENSOR, TIME = "e" * 64, "S123", "2026-11-29T12:00:00+00:00"


def frame(sensor: str = SENSOR, **changes):
    return replace(small_frame(), origin=FrameOrigin(sensor, TIME), **changes)


def face(sensor: str = SENSOR, name: str = "a1") -> Face:
    made = small_face()
    return replace(made, report=made.report.model_copy(update={
        "sensor": sensor, "captured_at": TIME, "capture_id": name, "warnings": ("odd",) * 9}))


def things(sensor: str = SENSOR, name: str = "a1"):
    made = face(sensor, name)
    hint = PublishedHint(sensor, 5, ("too_far", "dark"), "come closer", {"distance_mm": 1500.0})
    failed = CaptureFailedError(name, "NoFaceError", "no face " * 500)
    return {
        "frame": frame(sensor), "calibration": frame(sensor).calibration, "face": made,
        "initial": made.initial, "dense": made.dense, "report": made.report,
        "seeds": Seeds(made.initial.points, made.initial.colors, np.zeros((1, 2), np.int32)),
        "published": PublishedFace(EPOCH, 17, name, made),
        "failure": PublishedFailure(EPOCH, 17, name, failed), "hint": hint,
        "preview": PublishedPreview(EPOCH, 8, 5, sensor, (640, 480), b"\xff" * 30_000, hint, None),
    }


LINES = {
    "frame": f"<RgbdFrame: depth 8x6, 100% of it measured, color 10x7, S123, {TIME}>",
    "calibration": "<Calibration: depth 8x6 of focal length 10.0, color 10x7 of focal length 10.0, "
                   "25.0 mm apart>",
    "face": "<Face: a1, 26 measured points, 102 dense points, sigma 1.31 mm (median), S123, "
            f"{TIME}>",
    "initial": "<PointCloud: 26 points, 16 x 22 x 2 mm>",
    "dense": "<DenseCloud: 102 points, 16 x 22 x 2 mm, sigma 1.31 mm (median), grid 12x9 every "
             "2.00 mm>",
    "report": "<Report: a1, 26 measured points, 102 dense points, noise 0.50 mm, best, 9 warnings, "
              f"S123, {TIME}>",
    "seeds": "<Seeds: 26 points, 16 x 22 x 2 mm>",
    "published": f"<PublishedFace: number 17, a1, 102 dense points, S123, {TIME}>",
    "failure": "<PublishedFailure: number 17, a1, NoFaceError>",
    "hint": "<PublishedHint: S123, come closer, too_far, dark>",
    "preview": "<PublishedPreview: number 8, S123, 640x480, come closer>",
}


@pytest.mark.parametrize("kind", LINES)
def test_a_thing_says_what_it_is_in_one_short_line(kind):
    assert repr(things()[kind]) == str(things()[kind]) == LINES[kind]


@pytest.mark.parametrize("kind", LINES)
def test_whatever_its_names_are(kind):
    for name in ("x" * 256, "\n\x1b[2J", ""):
        line = repr(things(name, name)[kind])
        assert len(line) < 200
        assert line.isprintable()


def test_where_no_sensor_is_known_its_source_is_said():
    origin = FrameOrigin(source="take.oni#3")
    assert repr(replace(small_frame(), origin=origin)) == (
        "<RgbdFrame: depth 8x6, 100% of it measured, color 10x7, take.oni#3>")


def test_how_the_hub_is():
    status = Status(
        request=1, epoch="0f", sequence=1, hub_version="1", sensors=("S1", "S2"), workers=("w",),
        pressed=0, queued=1, working=2, done=3, failed=0, dead=0, refused={}, presses_refused={},
        since_start={})
    assert repr(status) == (
        "<Status: ready, sensors: S1 S2, 1 worker, 3 waiting, 3 done>")
    assert repr(status.model_copy(update={"obstacle": "disk", "sensors": ()})).startswith(
        "<Status: disk, sensors: none, ")


def test_what_is_empty_or_without_color():
    made = small_face()
    none = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8)
    assert repr(replace(made.initial, points=none[0], colors=none[1])) == "<PointCloud: 0 points>"
    camera = small_frame().calibration.depth
    grey = replace(small_frame(), color=None, calibration=Calibration(depth=camera, color=camera))
    assert repr(grey) == "<RgbdFrame: depth 8x6, 100% of it measured, no color>"
    assert short_repr(grey) == "<RgbdFrame: >"
