"""What a live sensor offers, does and says of itself, and what becomes of it in a frame."""

import json
from typing import NamedTuple

import numpy as np
import pytest

from denseface.capture.calibration import DepthToColor
from denseface.capture.frame import RgbdFrame
from denseface.capture.npz import load_frame
from tests.simulator import KINECT_DEFAULT
from tests.virtual_sensor import presets
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Call, Control, Driver, Format, Honesty, Mode
from tests.virtual_sensor.process import environment, play, run_python
from tests.virtual_sensor.scenes import cheap_frames

DEPTH, COLOR = cheap_frames(1)[0]
FINE, RGB, YUV, YUYV = Format.DEPTH_100_UM, Format.RGB888, Format.YUV422, Format.YUYV
_LOOK = """
import json, sys
from itertools import islice
from denseface.capture.npz import save_frame
from denseface.capture.openni2 import LiveSource
for uri in sys.argv[2:]:
    with LiveSource(uri) as source:
        for frame in islice(source, 2): pass
        save_frame(frame, f"{sys.argv[1]}/{uri}.npz")
        print(json.dumps([source.streams.notes, source.wrong_size, frame.calibration_origin]))
"""
_RECORD = """
import sys
from pathlib import Path
from tests.virtual_sensor.recorder import record
record(Path(sys.argv[1]), int(sys.argv[2]))
"""


class Seen(NamedTuple):
    frame: RgbdFrame
    notes: list[str]
    wrong_size: int
    origin: str
    """Of the calibration."""


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip"
    write_clip(path, [(DEPTH, COLOR)], calibration=KINECT_DEFAULT.calibration)
    return path


@pytest.fixture
def sensors(tmp_path, clip):
    """As many sensors as tests want: a process that opens one after another takes less time."""
    made: list[Control] = []

    def make(count: int) -> list[Control]:
        made.extend(Control(tmp_path / f"sensor{n}", clip, uri=f"virtual:{n}")
                    for n in range(count))
        return made

    yield make
    for control in made:
        control.close()


@pytest.fixture
def sensor(sensors):
    return sensors(1)[0]


def look(tmp_path, *sensors: Control) -> list[Seen]:
    """Give the second frame of each sensor, what was noted of it, and how many were dropped."""
    uris = [sensor.uri for sensor in sensors]
    done = run_python(_LOOK, tmp_path, *uris, env=environment(controls=sensors))
    assert done.returncode == 0, done.stderr
    return [Seen(load_frame(tmp_path / f"{uri}.npz"), *json.loads(line))
            for uri, line in zip(uris, done.stdout.splitlines(), strict=True)]


def honest_or_not(sensors):
    return zip(Honesty, sensors(len(Honesty)), strict=True)


def frame_of(sensor):
    (frame,), _ = play("openni2:", environment(controls=[sensor]), max_frames=1)
    return frame


def refusal(sensor):
    done = run_python("from denseface.capture import open_source\nopen_source('openni2:')",
                      env=environment(controls=[sensor]))
    assert done.returncode == 1
    return done.stderr.splitlines()[-1].partition("SensorError: ")[2]


def off(image, expected):
    return float(np.abs(image.astype(float) - expected).mean())


OFFERS = [
    ([Mode(320, 240)], [Mode(320, 240, format=RGB)], (320, 240, 1000, 320, 240)),
    ([Mode(320, 240)], [Mode(format=RGB)], (320, 240, 1000, 640, 480)),
    ([Mode()], [Mode(1280, 1024, format=RGB)], (640, 480, 1000, 1280, 1024)),
    ([Mode()], [Mode(format=YUV)], (640, 480, 1000, 640, 480)),
    ([Mode()], [Mode(format=YUYV)], (640, 480, 1000, 640, 480)),
    ([Mode(fps=15)], [Mode(fps=15, format=RGB)], (640, 480, 1000, 640, 480)),
    ([Mode(320, 240, 60)], [Mode(320, 240, 60, RGB)], (320, 240, 1000, 320, 240)),
    ([Mode(640, 400)], [Mode(format=RGB)], (640, 400, 1000, 640, 480)),
    ([Mode(format=FINE)], [Mode(format=RGB)], (640, 480, 100, 640, 480)),
    # The best comes last.
    ([Mode(320, 240), Mode(format=FINE), Mode()],
     [Mode(1280, 1024, format=YUV), Mode(format=YUV), Mode(format=RGB)],
     (640, 480, 1000, 640, 480)),
]


def test_the_best_modes_that_are_offered(sensors, tmp_path):
    made = sensors(len(OFFERS))
    for sensor, (depth, color, _) in zip(made, OFFERS, strict=True):
        sensor.depth.offer(*depth)
        sensor.color.offer(*color)
    for seen, (_, color_modes, expected) in zip(look(tmp_path, *made), OFFERS, strict=True):
        frame, cameras = seen.frame, seen.frame.calibration
        (height, width), (rows, columns) = frame.depth.shape, frame.rgb.shape[:2]
        assert (width, height, frame.depth_meaning.unit_um, columns, rows) == expected
        assert cameras.depth.fx == pytest.approx(575.8 * width / 640, abs=0.05)
        assert cameras.color.fx == pytest.approx(525 * columns / 640)
        assert (cameras.depth.cx, cameras.depth.cy) == (width / 2 - 0.5, height / 2 - 0.5)
        assert cameras.color.cy == (479.5 if rows == 1024 else rows / 2 - 0.5)
        assert seen.notes == []
        if (columns, rows) == (640, 480):  # YUV has half the columns of colour
            exact = color_modes[-1].format is RGB
            assert np.abs(frame.rgb.astype(float) - COLOR).mean() <= (0 if exact else 3)


def test_an_xtion_a_structure_sensor_a_kinect_and_one_that_says_nothing(sensors, tmp_path):
    xtion, structure, kinect, bare = made = sensors(4)
    presets.as_xtion(xtion)
    presets.as_structure_sensor(structure)
    presets.as_kinect(kinect)
    bare.driver = Driver.BARE
    for control, name in zip(made, "abcd", strict=True):
        control.uri = f"freenect:{name}" if control is kinect else name
    *_, last = looked = look(tmp_path, *made)
    seen = [each.frame for each in looked]
    for frame in seen:
        np.testing.assert_array_equal(frame.depth, DEPTH)
        if frame is not seen[1]:
            np.testing.assert_array_equal(frame.rgb, COLOR)
    assert seen[1].color is None
    cameras = seen[2].calibration
    assert (cameras.depth.fx, cameras.color.fx) == (575.8, 525)
    assert "default depth f 575.8 (Kinect v1), default DCRCDIS 2.3" in last.origin


def test_what_is_offered_is_named_where_nothing_can_be_read(sensor):
    sensor.depth.present = False
    assert refusal(sensor) == "openni2: has no depth stream; depth is needed"
    sensor.depth.present = True
    sensor.color.modes = "640x480@30:rgb888,641x480@30:yuyv"
    frame_of(sensor)
    sensor.color.modes = "641x480@15:yuyv,641x480@30:yuyv"
    assert refusal(sensor) == (
        "openni2: offers no modes that can be read: depth 640x480 DEPTH_1_MM at 30/s (expected "
        "DEPTH_1_MM or DEPTH_100_UM), color 641x480 YUYV at 15/30/s (expected RGB888 or YUV422 or "
        "YUYV)")


def test_mirroring(sensors, tmp_path):
    """Off in the frame, or said that it is not known; a lie has to be measured."""
    tried = [*honest_or_not(sensors)]
    for honesty, sensor in tried:
        sensor.depth.mirroring = sensor.color.mirroring = honesty
    for (honesty, _), seen in zip(tried, look(tmp_path, *(s for _, s in tried)), strict=True):
        turned = honesty in (Honesty.HONEST, Honesty.SECRET, Honesty.REFUSED)
        np.testing.assert_array_equal(seen.frame.depth, DEPTH if turned else DEPTH[:, ::-1])
        np.testing.assert_array_equal(seen.frame.rgb, COLOR if turned else COLOR[:, ::-1])
        assert seen.notes == ([] if honesty is not Honesty.MISSING else [
            "the driver does not say whether its depth is mirrored",
            "the driver does not say whether its color is mirrored"])


def test_cropping_is_switched_off_or_undone(sensors, tmp_path):
    tried = [*honest_or_not(sensors)]
    for honesty, sensor in tried:
        for stream in (sensor.depth, sensor.color):
            stream.cropping, stream.mirrored_at_start = honesty, False
            stream.crop_left, stream.crop_top = 160, 90
            stream.crop_width, stream.crop_height = 320, 240
    part = np.zeros((480, 640), bool)
    part[90:330, 160:480] = True
    for (honesty, _), seen in zip(tried, look(tmp_path, *(s for _, s in tried)), strict=True):
        off = honesty in (Honesty.HONEST, Honesty.SECRET)
        np.testing.assert_array_equal(seen.frame.depth, np.where(part | off, DEPTH, 0))
        np.testing.assert_array_equal(
            seen.frame.rgb, np.where(part[..., None] | off, COLOR, 0))
        assert (seen.notes, seen.wrong_size) == ([] if off else [
            f"the driver sends 320x240 pixels of {kind} from 160, 90, cropped"
            for kind in ("depth", "color")], 0)


def test_registration_is_switched_off_or_said(sensors, tmp_path):
    """A driver that lies about it is found out by measuring."""
    tried = [*honest_or_not(sensors)]
    for honesty, sensor in tried:
        sensor.registration, sensor.registered_at_start = honesty, True
    for (honesty, _), seen in zip(tried, look(tmp_path, *(s for _, s in tried)), strict=True):
        off = honesty in (Honesty.HONEST, Honesty.SECRET)
        assert seen.frame.registered == (not off)
        assert seen.notes == (["the driver keeps registering depth to the color camera"]
                              if honesty is Honesty.REFUSED else [])
        if off:
            np.testing.assert_array_equal(seen.frame.depth, DEPTH)


def test_registered_depth_of_another_size_than_the_colour_image(sensor, tmp_path):
    """640x480 is in the pixels of the upper 960 rows of 1280x1024."""
    sensor.registration, sensor.registered_at_start = Honesty.REFUSED, True
    sensor.color.offer(Mode(1280, 1024, format=RGB))
    ((frame, *_),) = look(tmp_path, sensor)
    assert frame.rgb.shape == (1024, 1280, 3)
    assert (frame.depth_camera.fx, frame.depth_camera.cy) == (pytest.approx(525), 239.5)
    assert frame.depth_to_color == DepthToColor()


@pytest.mark.parametrize("pixels", [YUV, YUYV])
def test_a_recording_with_yuv_colors(sensor, tmp_path, pixels):
    sensor.color.offer(Mode(format=pixels))
    oni = tmp_path / "yuv.oni"
    done = run_python(_RECORD, oni, 2, env=environment(controls=[sensor]))
    assert done.returncode == 0, done.stderr
    (frame,), _ = play(oni, max_frames=1)
    np.testing.assert_array_equal(frame.depth.ravel()[:-32], DEPTH.ravel()[:-32])
    assert np.abs(frame.rgb.astype(float) - COLOR).mean() < 3


def test_one_frame_of_another_size_is_dropped_and_a_size_that_is_kept_to_is_taken(
        sensors, tmp_path):
    once, always = made = sensors(2)
    for sensor, count in zip(made, (1, -1), strict=True):
        sensor.depth.mirrored_at_start = False
        sensor.depth.wrong_size_next = count
    first, second = look(tmp_path, once, always)
    assert (first.frame.depth.shape, first.notes, first.wrong_size) == ((480, 640), [], 1)
    np.testing.assert_array_equal(second.frame.depth, DEPTH[:240])
    assert second.notes == ["the driver says that depth is 640x480 at 30/s as DEPTH_1_MM, and "
                            "sends 640x240 as DEPTH_1_MM"]
    assert second.wrong_size >= 3


def test_a_driver_that_takes_no_mode_keeps_its_own(sensor, tmp_path):
    sensor.depth.offer(Mode(320, 240), Mode())
    sensor.refuse = Call.SET_PROPERTY
    assert look(tmp_path, sensor)[0].frame.depth.shape == (240, 320)


def test_an_astra_on_orbbecs_driver(sensors, tmp_path):
    astra, low = made = sensors(2)
    for sensor in made:
        presets.as_astra(sensor)
    low.uri = "low"
    astra.uri = "astra"
    low.depth.offer(Mode(640, 400))
    (frame, _, _, origin), (wide, *_) = look(tmp_path, *made)
    true = KINECT_DEFAULT.calibration
    assert origin == "device: Orbbec factory calibration"
    assert frame.calibration.depth.fx == pytest.approx(true.depth.fx, rel=1e-5)
    assert frame.calibration.depth_to_color.translation_mm == pytest.approx(
        true.depth_to_color.translation_mm, rel=1e-5)
    assert wide.calibration.depth.cy == pytest.approx(true.depth.cy - 40, abs=1e-3)
    np.testing.assert_array_equal(wide.depth, DEPTH[40:440])
