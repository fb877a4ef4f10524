"""The virtual sensor does what it is told, as the bare binding sees it."""

import math
import signal
import time

import cv2
import numpy as np
import pytest

from tests.simulator import KINECT_CALIBRATED, KINECT_DEFAULT
from tests.virtual_sensor import presets
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import (
    Call,
    Control,
    DeviceState,
    Driver,
    Format,
    Honesty,
    Mode,
    OpenFault,
    Stamps,
)
from tests.virtual_sensor.marks import read_mark
from tests.virtual_sensor.process import environment
from tests.virtual_sensor.raw import Raw
from tests.virtual_sensor.scenes import cheap_frames
from tests.waiting import LIMIT_S, until

PERIOD_US = 33_333
FRAMES = cheap_frames(3)
NOT_SUPPORTED = "ONI_STATUS_NOT_SUPPORTED"


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip"
    write_clip(path, FRAMES, calibration=KINECT_DEFAULT.calibration)
    return path


@pytest.fixture
def sensor(tmp_path, clip):
    with Control(tmp_path / "sensor", clip, marks=True) as control:
        yield control


@pytest.fixture
def raw(sensor):
    with Raw(environment(controls=[sensor])) as process:
        yield process


def opened(raw: Raw, *kinds: str) -> Raw:
    raw.ask("open()")
    raw.ask(f"start(*{kinds})")
    return raw


def shown(frame):
    """Give the depth and colour of the clip that a frame is of: some may have been lost."""
    return FRAMES[(frame["timestamp"] - 1_000_000) // PERIOD_US % len(FRAMES)]


def events(raw: Raw, count: int):
    return until(lambda: len(found := raw.ask("events")) >= count and found)


def test_a_frame_says_when_it_was_exposed(sensor, raw):
    opened(raw)
    for pipeline_us in (0, 66_000):
        sensor.pipeline_us = pipeline_us
        sensor.wait_frames(4)  # those under way were exposed before
        raw.ask("read('depth')")
        for kind in ("depth", "color"):
            before = raw.ask("read(" + repr(kind) + ")")
            frame = raw.ask(f"read({kind!r})")
            late_us = (time.monotonic_ns() - frame["exposed_ns"]) / 1000
            assert late_us >= pipeline_us
            numbers = frame["number"] - before["number"]
            assert frame["exposed_ns"] - before["exposed_ns"] == numbers * PERIOD_US * 1000
            assert frame["timestamp"] == 1_000_000 + frame["number"] * PERIOD_US
    assert sensor.depth.last_exposed_ns >= frame["exposed_ns"]


def test_two_devices_at_once_and_one_without_color(tmp_path, clip, sensor):
    sensor.update({"uri": "virtual:a", "serial": "A1", "usb_vendor": 0x1D27, "usb_product": 0x601})
    other = Control(tmp_path / "other", clip, marks=True)
    presets.as_structure_sensor(other)
    with Raw(environment(controls=[sensor, other])) as raw:
        assert sorted(raw.ask("uris()")) == ["1d27/0600@1/9", "virtual:a"]
        raw.ask("open('1d27/0600@1/9')")
        assert raw.ask("device.get_sensor_info(2)") is None
        raw.ask("start('depth')")
        assert raw.ask("read('depth')")["width"] == 320
        assert raw.ask("[device.device_info.vendor.decode(), device.device_info.usbVendorId, "
                       "device.get_property(3, openni2.ctypes.c_char * 64).value.decode()]") == [
            "PrimeSense", 0x1D27, "24817"]
    assert (sensor.opens, other.opens, sensor.loads) == (0, 1, 1)


@pytest.mark.parametrize("mode", [
    Mode(320, 240, 60), Mode(640, 400, 30, Format.DEPTH_100_UM), Mode(640, 480, 15)])
def test_depth_modes(sensor, raw, mode):
    sensor.depth.offer(Mode(), mode)
    raw.ask("open()")
    assert raw.ask("modes(3)") == [[640, 480, 30, 100], [
        mode.width, mode.height, mode.fps, 101 if mode.format == Format.DEPTH_100_UM else 100]]
    unit = 10 if mode.format == Format.DEPTH_100_UM else 1
    raw.ask("create('depth')")
    raw.ask(f"depth.configure_mode({mode.width}, {mode.height}, {mode.fps}, {99 + min(unit, 2)})")
    raw.ask("start('depth')")
    first, frame = raw.ask("read('depth')"), raw.ask("read('depth')")
    assert (frame["width"], frame["height"]) == (mode.width, mode.height)
    numbers = (frame["timestamp"] - first["timestamp"]) / (1_000_000 // mode.fps)
    assert numbers == round(numbers) > 0
    middle = raw.image()[:, ::-1][mode.height // 2, mode.width // 8]
    assert middle == 1600 * unit  # the wall


@pytest.mark.parametrize(("pixels", "code"), [
    (Format.RGB888, 200), (Format.YUV422, 201), (Format.YUYV, 205)])
def test_color_formats(sensor, raw, pixels, code):
    sensor.marks = False
    sensor.color.mirrored_at_start = False
    sensor.color.offer(Mode(format=pixels))
    opened(raw, "color")
    wanted = shown(raw.ask("read('color')"))[1].astype(float)
    data = np.frombuffer(raw.image().tobytes(), np.uint8).astype(float)
    if pixels is not Format.RGB888:
        four = data.reshape(-1, 4)
        y, u, v = ((four[:, [1, 3]], four[:, 0], four[:, 2]) if pixels is Format.YUV422
                   else (four[:, [0, 2]], four[:, 1], four[:, 3]))
        y, u, v = 1.164 * (y - 16), u[:, None] - 128, v[:, None] - 128
        data = np.stack([y + 1.596 * v, y - 0.813 * v - 0.391 * u, y + 2.018 * u], -1)
    off = np.abs(data.reshape(480, 640, 3) - wanted)
    assert np.median(off) < 1.5
    assert (off.mean() == 0) == (pixels is Format.RGB888)


def test_a_larger_color_image_has_the_small_one_in_its_upper_part(sensor, raw):
    sensor.color.offer(Mode(1280, 1024, 30, Format.RGB888))
    sensor.marks = False
    sensor.color.mirrored_at_start = False
    opened(raw, "color")
    frame = raw.ask("read('color')")
    large = raw.image()
    np.testing.assert_array_equal(large[:960:2, ::2], shown(frame)[1])
    assert (large[960:] == large[959]).all()


def test_unplugged_and_replugged_under_another_uri(sensor, raw):
    opened(raw)
    sensor.unplug()
    assert events(raw, 1) == [["disconnected", "virtual:0"]]
    assert raw.ask("uris()") == []
    sent = sensor.depth.frames
    sensor.replug("virtual:7")
    assert events(raw, 2)[1] == ["connected", "virtual:7"]
    assert sensor.depth.frames - sent <= 1  # what was open stays dead
    raw.ask("[depth.close(), color.close(), device.close()]")
    raw.ask("[open('virtual:7'), create(), start()]")
    sensor.wait_frames()
    assert (sensor.opens, sensor.closes) == (2, 1)


def test_a_driver_that_says_nothing_of_it(sensor, raw):
    sensor.hotplug = False
    opened(raw)
    sensor.unplug()
    assert raw.ask("read('depth', 0.5) and read('depth', 0.5) and read('depth', 0.5)") is None
    assert (raw.ask("events"), raw.ask("uris()")) == ([], ["virtual:0"])


@pytest.mark.parametrize(("call", "code"), [
    (Call.OPEN, "open()"), (Call.CREATE_STREAM, "create('depth')"), (Call.START, "start('depth')"),
    (Call.GET_PROPERTY, "depth.get_max_pixel_value()"),
    (Call.SET_PROPERTY, "depth.set_mirroring_enabled(0)"), (Call.STOP, "stop('depth')"),
    (Call.DESTROY_STREAM, "depth.close()"), (Call.CLOSE, "[depth.close(), device.close()]"),
    (Call.SHUTDOWN, "openni2.unload()")])
def test_a_call_hangs_until_it_may_go_on(sensor, raw, call, code):
    for before in ("open()", "create('depth')", "start('depth')"):
        if before == code:
            break
        raw.ask(before)
    sensor.hang = call
    raw.tell(code)
    sensor.wait_hanging(call)
    sensor.hang = Call.NONE
    raw.answer()
    assert sensor.hanging == Call.NONE


@pytest.mark.parametrize("fault", [OpenFault.BUSY, OpenFault.NO_PERMISSION])
def test_a_device_that_cannot_be_opened(sensor, raw, fault):
    sensor.open_fault = fault
    with pytest.raises(RuntimeError, match='Could not open "virtual:0": Failed to'):
        raw.ask("open()")
    sensor.open_fault = OpenFault.NONE
    opened(raw)


def test_a_device_that_is_not_announced(sensor, raw):
    raw.ask("uris()")
    sensor.announced = False
    assert events(raw, 1) == [["disconnected", "virtual:0"]]
    sensor.announced = True
    assert events(raw, 2)[1] == ["connected", "virtual:0"]


def test_an_error_state_and_back(sensor, raw):
    opened(raw)
    sensor.state = DeviceState.ERROR
    assert events(raw, 1) == [["state", "virtual:0", 1]]
    sensor.wait_frames()
    sensor.state = DeviceState.OK
    assert events(raw, 2)[1] == ["state", "virtual:0", 0]


def test_frames_are_lost_frozen_garbled_and_of_a_wrong_size(sensor, raw):
    opened(raw)
    raw.ask("read('depth')")
    sensor.depth.drop_next = 3
    until(lambda: sensor.depth.drop_next == 0 and sensor.depth.lost >= 3)
    sensor.depth.wrong_size_next = -1
    sensor.wait_frames(2)
    raw.ask("read('depth')")
    assert raw.ask("read('depth')")["height"] == 240
    sensor.depth.wrong_size_next = 0
    sensor.depth.garbled_next = -1
    sensor.wait_frames(2)
    raw.ask("read('depth')")
    assert "number" not in raw.ask("read('depth')")
    sensor.depth.garbled_next = 0
    sensor.depth.frozen = sensor.color.frozen = True
    sensor.color.frozen_stamps = True
    sensor.wait_frames(2)
    for kind in ("depth", "color"):
        raw.ask(f"read({kind!r})")
        a, b = raw.ask(f"read({kind!r})"), raw.ask(f"read({kind!r})")
        assert a["number"] == b["number"]
        assert (a["timestamp"] == b["timestamp"]) == (kind == "color")
    sensor.depth.silent = True
    assert raw.ask("[read('depth', 0.2) for _ in range(3)][-1]") is None


def test_stamps(sensor, raw):
    sensor.color.delay_us = 11_700
    sensor.depth.drift_ppm = 20_000
    opened(raw)

    def stamps(kind):
        raw.ask(f"read({kind!r})")
        return raw.ask(f"read({kind!r})")

    depth, color = stamps("depth"), stamps("color")
    assert depth["timestamp"] == 1_000_000 + round(depth["number"] * PERIOD_US * 1.02)
    assert color["timestamp"] == 1_000_000 + color["number"] * PERIOD_US + 11_700
    apart_ns = color["exposed_ns"] - depth["exposed_ns"]
    assert apart_ns == (color["number"] - depth["number"]) * PERIOD_US * 1000 + 11_700_000
    sensor.color.stamp_offset_us = 1_000_000
    sensor.wait_frames(2)
    color = stamps("color")
    assert color["timestamp"] == 2_000_000 + color["number"] * PERIOD_US + 11_700
    sensor.color.stamp_offset_us = 0
    for kind, wanted in ((Stamps.NONE, 0), (Stamps.MILLISECONDS, None), (Stamps.EPOCH, None)):
        sensor.color.stamps = kind
        sensor.wait_frames(2)
        color = stamps("color")
        if kind is Stamps.MILLISECONDS:
            wanted = (1_000_000 + color["number"] * PERIOD_US + 11_700) // 1000
        if kind is Stamps.EPOCH:
            assert abs(color["timestamp"] / 1e6 - time.time()) < 30
        else:
            assert color["timestamp"] == wanted


def test_both_streams_are_exposed_at_once_where_they_are_synchronized(sensor, raw):
    sensor.color.delay_us = 11_700
    raw.ask("[open(), create()]")
    raw.ask("device.set_depth_color_sync_enabled(True)")
    raw.ask("start()")
    until(lambda: sensor.synchronized)
    sensor.wait_frames(2)
    depth, color = (raw.ask(f"(read({kind!r}), read({kind!r}))[1]") for kind in ("depth", "color"))
    assert color["timestamp"] == 1_000_000 + color["number"] * PERIOD_US
    assert (color["exposed_ns"] - depth["exposed_ns"]) % (PERIOD_US * 1000) == 0


@pytest.mark.parametrize("honesty", list(Honesty))
def test_mirroring(sensor, raw, honesty):
    sensor.depth.mirroring = honesty
    sensor.depth.offer(Mode())
    raw.ask("open()")
    raw.ask("create('depth')")
    accepted = honesty not in (Honesty.MISSING, Honesty.REFUSED)
    if accepted:
        raw.ask("depth.set_mirroring_enabled(False)")
        assert raw.ask("depth.get_mirroring_enabled()") == 0
    else:
        with pytest.raises(RuntimeError, match=NOT_SUPPORTED):
            raw.ask("depth.set_mirroring_enabled(False)")
    raw.ask("start('depth')")
    acts = honesty in (Honesty.HONEST, Honesty.SECRET)
    assert raw.ask("read('depth')")["mirrored"] == (not acts)


@pytest.mark.parametrize("honesty", list(Honesty))
def test_registration(sensor, raw, honesty):
    sensor.registration = honesty
    sensor.registered_at_start = honesty in (Honesty.STUCK, Honesty.REFUSED)
    sensor.marks = False
    sensor.depth.mirrored_at_start = False
    raw.ask("open()")
    if honesty in (Honesty.MISSING, Honesty.REFUSED):
        with pytest.raises(RuntimeError):
            raw.ask("device.set_image_registration_mode(1)")
    else:
        raw.ask("device.set_image_registration_mode(1)")
        says = 0 if honesty is Honesty.SECRET else 1
        assert raw.ask("int(device.get_image_registration_mode())") == says
    raw.ask("start('depth')")
    own, color = shown(raw.ask("read('depth')"))
    depth = raw.image()
    moved = honesty in (Honesty.HONEST, Honesty.SECRET, Honesty.STUCK, Honesty.REFUSED)
    assert (depth != own).any() == moved
    if moved:
        # The ball's outline is where the colour image shows it.
        ball, red = (depth > 0) & (depth < 1000), color[..., 2] < 75
        red &= color[..., 1] < 95
        both = (ball & red)[:, 40:600].sum() / (ball | red)[:, 40:600].sum()
        assert both > 0.93


def test_registration_with_distortion_and_rotation_is_the_calibrations(tmp_path):
    calibration = KINECT_CALIBRATED.calibration
    depth = np.zeros((480, 640), np.uint16)
    at = [(100, 80), (320, 240), (600, 400)]
    for u, v in at:
        depth[v, u] = 900
    write_clip(tmp_path / "clip", [(depth, np.zeros((480, 640, 3), np.uint8))],
               calibration=calibration)
    sensor = Control(tmp_path / "sensor", tmp_path / "clip", registered_at_start=True)
    sensor.depth.mirrored_at_start = False
    with Raw(environment(controls=[sensor])) as raw:
        opened(raw, "depth").ask("read('depth')")
        found = {(u, v) for v, u in np.argwhere(raw.image())}
    points = calibration.depth.back_project(np.array(at, float), 900.0)
    wanted = calibration.color.project(calibration.depth_to_color.apply(points))
    assert found == {(round(u), round(v)) for u, v in wanted}


@pytest.mark.parametrize("honesty", [Honesty.HONEST, Honesty.SECRET, Honesty.STUCK, Honesty.IDLE])
def test_cropping(sensor, raw, honesty):
    sensor.marks = False
    sensor.depth.cropping = honesty
    sensor.depth.mirrored_at_start = False
    if honesty is Honesty.STUCK:
        sensor.depth.update(
            {"crop_left": 40, "crop_top": 20, "crop_width": 320, "crop_height": 200})
    raw.ask("open()")
    raw.ask("create('depth')")
    raw.ask("depth.set_cropping(40, 20, 320, 200)" if honesty is not Honesty.STUCK
            else "depth.reset_cropping()")
    raw.ask("start('depth')")
    frame = raw.ask("read('depth')")
    acts = honesty is not Honesty.IDLE
    assert (frame["width"], frame["height"]) == ((320, 200) if acts else (640, 480))
    assert bool(frame["croppingEnabled"]) == (honesty in (Honesty.HONEST, Honesty.STUCK))
    if acts:
        np.testing.assert_array_equal(raw.image(), shown(frame)[0][20:220, 40:360])


def test_exposure_settles_and_can_be_locked(sensor, raw, tmp_path):
    write_clip(tmp_path / "clip", FRAMES[:1])
    sensor.clip = str(tmp_path / "clip")
    sensor.settle_frames = 10_000  # not before it is locked
    sensor.marks = False
    sensor.color.mirrored_at_start = False
    raw.ask("open()")
    raw.ask("create('color')")
    with pytest.raises(RuntimeError, match="ONI_STATUS_ERROR"):
        raw.ask("color.set_property(101, openni2.ctypes.c_int(0))")  # only while it streams
    raw.ask("start('color')")
    raw.ask("read('color')")
    raw.ask("color.set_property(101, openni2.ctypes.c_int(0))")
    raw.ask("color.set_property(100, openni2.ctypes.c_int(0))")
    early = raw.ask("(read('color'), read('color'), image.reshape(-1, 3).mean(0).tolist())[2]")
    until(lambda count=sensor.color.frames: sensor.color.frames > count + 40)
    late = raw.ask("(read('color'), read('color'), image.reshape(-1, 3).mean(0).tolist())[2]")
    assert early == pytest.approx(late)
    settled = FRAMES[0][1].reshape(-1, 3).mean(0)
    assert late[0] / settled[0] < 0.8
    assert late[0] / settled[0] > late[1] / settled[1] > late[2] / settled[2]
    sensor.settle_frames = 30
    for switch in (100, 101):
        raw.ask(f"color.set_property({switch}, openni2.ctypes.c_int(1))")
    until(lambda count=sensor.color.frames: sensor.color.frames > count + 40)
    raw.ask("read('color')")
    late = raw.ask("(read('color'), image.reshape(-1, 3).mean(0).tolist())[1]")
    assert late == pytest.approx(list(settled), abs=2)


def depth_property(raw: Raw, number: int, kind: str):
    return raw.ask(f"depth.get_property({number}, openni2.ctypes.{kind}).value")


ZPD, ZPPS, DCRCDIS = 0x1080100C, 0x1080100D, 0x1080100F


@pytest.mark.parametrize("driver", list(Driver))
def test_what_the_drivers_say_of_themselves(tmp_path, clip, driver):
    sensor = Control(tmp_path / "sensor", clip, driver=driver, serial="S1")
    with Raw(environment(controls=[sensor])) as raw:
        raw.ask("open()")
        raw.ask("create()")
        if driver is Driver.BARE:
            for asked in (lambda: depth_property(raw, ZPPS, "c_double"),
                          lambda: raw.ask("color.get_property(1, openni2.ctypes.c_float).value")):
                with pytest.raises(RuntimeError, match=NOT_SUPPORTED):
                    asked()
            return
        freenect = driver is Driver.FREENECT
        assert depth_property(raw, ZPD, "c_uint64") == 120
        assert depth_property(raw, ZPPS, "c_double") == (0.1052 if freenect else 0.1042)
        fov = raw.ask("color.get_property(1, openni2.ctypes.c_float).value")
        assert math.degrees(fov) == pytest.approx(62.0 if freenect else 62.73, abs=0.01)
        serial = "device.get_property(3, openni2.ctypes.c_char * 64).value.decode()"
        if freenect:
            for asked in (lambda: depth_property(raw, DCRCDIS, "c_double"),
                          lambda: raw.ask(serial)):
                with pytest.raises(RuntimeError, match=NOT_SUPPORTED):
                    asked()
            raw.ask("[depth.close(), color.close(), device.close()]")
            with pytest.raises(RuntimeError, match="Could not find device"):
                raw.ask("open()")
        else:
            assert raw.ask(serial) == "S1"
        if driver is Driver.ORBBEC:
            factory = raw.ask("list(device.get_property(14, openni2.ctypes.c_float * 31))")
            assert factory[:4] == pytest.approx([575.8, 575.8, 319.5, 239.5])
            assert factory[4:8] == pytest.approx([525, 525, 319.5, 239.5])
            assert factory[17:20] == pytest.approx([-23, 0, 0])


def test_frames_come_faster_at_a_raised_speed(sensor, raw):
    sensor.speed = 10.0
    opened(raw, "depth")
    first, frame = raw.ask("read('depth')"), raw.ask("read('depth')")
    numbers = frame["number"] - first["number"]
    assert frame["exposed_ns"] - first["exposed_ns"] == numbers * PERIOD_US * 100
    assert frame["timestamp"] - first["timestamp"] == pytest.approx(
        numbers * PERIOD_US / 10, abs=1)


def test_freenect_crashes_where_registration_is_asked_for_too_early(tmp_path, clip):
    sensor = Control(tmp_path / "sensor", clip)
    presets.as_kinect(sensor)
    with Raw(environment(controls=[sensor])) as raw:
        raw.ask("open()")
        raw.tell("device.get_image_registration_mode()")
        assert raw.process.wait(LIMIT_S) == -signal.SIGSEGV
    with Raw(environment(controls=[sensor])) as raw:
        raw.ask("(open(), create())")
        assert raw.ask("int(device.get_image_registration_mode())") == 0


def test_a_mode_cannot_be_changed_while_the_stream_runs(sensor, raw):
    sensor.depth.offer(Mode(), Mode(320, 240))
    opened(raw, "depth")
    with pytest.raises(RuntimeError, match="ONI_STATUS_OUT_OF_FLOW"):
        raw.ask("depth.configure_mode(320, 240, 30, 100)")
    raw.ask("stop('depth')")
    raw.ask("depth.configure_mode(320, 240, 30, 100)")
    raw.ask("start('depth')")
    until(lambda: raw.ask("read('depth')")["width"] == 320)


def test_the_mark_outlives_a_preview(sensor, raw):
    sensor.color.mirrored_at_start = False
    opened(raw, "color")
    frame = raw.ask("read('color')")
    small = cv2.resize(raw.image(), (320, 240), interpolation=cv2.INTER_AREA)
    for quality in (60, 90):
        _, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, quality])
        mark = read_mark(cv2.imdecode(data, cv2.IMREAD_COLOR))
        assert mark == (frame["number"], frame["exposed_ns"], False)
    with pytest.raises(ValueError, match="no mark"):
        read_mark(FRAMES[0][1])
