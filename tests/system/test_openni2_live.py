"""The virtual sensor, live, through the real OpenNI2 library."""

import re
import subprocess
import sys

import numpy as np
import pytest

from tests.system.running import REPOSITORY, killed_at_the_end
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control, OpenFault
from tests.virtual_sensor.process import environment, play, run_python
from tests.waiting import LIMIT_S

PERIOD_US = 33_333
START_US = 1_000_000


@pytest.fixture(scope="module")
def shown():
    rng = np.random.default_rng(5)
    return [(rng.integers(0, 6000, (480, 640), np.uint16),
             rng.integers(0, 256, (480, 640, 3), np.uint8)) for _ in range(3)]


@pytest.fixture(scope="module")
def clip(shown, tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip"
    write_clip(path, shown)
    return path


def number(stamp_us: int) -> int:
    index, rest = divmod(stamp_us - START_US, PERIOD_US)
    assert rest == 0
    return index


def test_frames_are_bit_exact_and_not_mirrored(clip, shown):
    frames, origin = play("openni2:", environment(clip), max_frames=6)
    assert len(frames) == 6
    for frame in frames:
        depth, color = shown[number(frame.depth_timestamp_us) % 3]
        np.testing.assert_array_equal(frame.depth, depth)
        np.testing.assert_array_equal(frame.rgb, color)
        assert frame.skew_us == 0
        assert not frame.registered
    stamps = [frame.depth_timestamp_us for frame in frames]
    assert stamps == sorted(set(stamps))
    assert origin.startswith("device: ZPD 120, ZPPS 0.1042, DCRCDIS 2.3, color field of view 62.7")
    calibration = frames[0].calibration
    assert calibration.depth.fx == pytest.approx(575.816, abs=1e-3)
    assert calibration.color.fx == pytest.approx(525, abs=1e-3)
    assert calibration.depth_to_color.translation_mm == pytest.approx((-23, 0, 0))


@pytest.mark.parametrize("skew_us", [-11_700, 11_700])
def test_the_skew_stays_on_the_frame(clip, skew_us):
    """On a busy machine the clocks of both streams are known to be one a little later."""
    code = ("from itertools import islice\nfrom denseface.capture import open_source\n"
            "with open_source('openni2:virtual:0') as source:\n"
            "    exact = (one for one in source if one.origin.skew_known_by == 'stamps')\n"
            "    print([frame.skew_us for frame in islice(exact, 3)])")
    done = run_python(code, env=environment(clip, skew_us=skew_us))
    assert (done.stdout, done.stderr) == (f"{[-skew_us] * 3}\n", "")


def test_depth_in_tenths_of_a_millimetre(clip, shown):
    (frame,), _ = play("openni2:", environment(clip, depth_unit="100um"), max_frames=1)
    depth, _ = shown[number(frame.depth_timestamp_us) % 3]
    np.testing.assert_array_equal(frame.depth, np.minimum(depth * np.uint32(10), 65535))
    assert frame.depth_meaning.unit_um == 100


def test_an_argument_wins_over_what_the_sensor_says(clip, tmp_path):
    (frame,), _ = play("openni2:", environment(clip), max_frames=1)
    mine = frame.calibration.model_copy(
        update={"color": frame.calibration.color.model_copy(update={"fx": 500.0})})
    path = tmp_path / "mine.json"
    path.write_text(mine.to_json())
    code = ("import sys; from denseface.capture import open_source\n"
            "with open_source('openni2:', sys.argv[1]) as source:\n"
            "    frame = next(iter(source))\n"
            "    print(frame.calibration.color.fx, frame.calibration_origin, source.frame_count)")
    done = run_python(code, path, env=environment(clip))
    assert done.stdout == f"500.0 argument {path.name} None\n"


def failing(uri: str, env: dict[str, str], code: str = "") -> tuple[str, str]:
    """Read until an error; give what was printed and the error's line."""
    done = run_python(
        "import sys\nfrom denseface.capture import open_source\n"
        "from denseface.capture.openni2 import LiveSource\n"
        + (code or "for frame in open_source(sys.argv[1]):\n    print(frame.depth_timestamp_us)"),
        uri, env=env)
    assert done.returncode == 1, done.stderr
    return done.stdout, done.stderr.splitlines()[-1]


def test_a_sensor_that_is_unplugged(clip):
    out, error = failing("openni2:", environment(clip, disconnect_after=4))
    assert len(out.splitlines()) <= 4
    assert error == ("denseface.capture.errors.SensorError: openni2: the sensor virtual:0 "
                     "was unplugged or failed")


def test_a_sensor_that_falls_silent(clip):
    code = ("source = LiveSource(timeout_s=0.5)\nfor frame in source:\n"
            "    print(frame.depth_timestamp_us)")
    out, error = failing("", environment(clip, end="stop"), code)
    assert len(out.splitlines()) <= 3
    assert re.match(r"denseface\.capture\.errors\.SensorTimeoutError: openni2: no depth and "
                    r"color pair within 0\.5 s", error)


def test_the_last_frame_of_a_sensor_that_fell_silent_is_given_once(clip):
    code = ("from denseface.capture.errors import SensorTimeoutError\n"
            "source = LiveSource(timeout_s=0.3)\n"
            "try:\n"
            "    while True: source.read()\n"
            "except SensorTimeoutError: pass\n"
            "source.read()")
    _, error = failing("", environment(clip, end="stop"), code)
    assert "SensorTimeoutError" in error


def test_what_waited_in_the_library_is_not_given(clip):
    """A frame is announced before the read: it gives the next one."""
    code = ("source = LiveSource()\n"
            "for _ in range(12): before = source.read().depth_timestamp_us\n"
            "while source.streams.wait(1.0) is None: pass\n"
            "time.sleep(0.02)\n"
            "print(source.read().depth_timestamp_us > before + 33_333)\n"
            "source.close()\nsource.close()")
    done = run_python("import time\nfrom denseface.capture.openni2 import LiveSource\n" + code,
                      env=environment(clip))
    assert done.stdout == "True\n", done.stderr


def test_a_sensor_without_depth_is_refused(clip):
    _, error = failing("openni2:", environment(clip, streams="color"))
    assert error == ("denseface.capture.errors.SensorError: openni2: has no depth stream; "
                     "depth is needed")


def test_a_sensor_without_a_color_camera(clip, shown):
    frames, origin = play("openni2:", environment(clip, streams="depth"), max_frames=3)
    assert origin == "device: ZPD 120, ZPPS 0.1042"
    for frame in frames:
        assert frame.color is None
        assert frame.calibration.color == frame.calibration.depth
        np.testing.assert_array_equal(frame.depth, shown[number(frame.depth_timestamp_us) % 3][0])


def test_no_sensor():
    _, error = failing("openni2:", environment())
    assert error == "denseface.capture.errors.SensorError: openni2: OpenNI2 finds no sensor"


@pytest.mark.parametrize(("opens", "busy"), [
    ("with LiveSource() as source: source.read()",
     'openni2: cannot be opened: Could not open "virtual:0": Failed to set USB interface!'),
    ("load(); choose('S1', 'openni2:S1')", "openni2:S1: no such sensor; found: virtual:0")])
def test_a_sensor_that_was_busy_can_be_opened_later_in_the_same_process(
        clip, tmp_path, opens, busy):
    """OpenNI2 counts the closing of what it could not open, and then crashes at the next."""
    code = ("import sys\nfrom denseface.capture.errors import SensorError\n"
            "from denseface.capture.openni2 import LiveSource\n"
            "from denseface.capture.openni2._devices import choose\n"
            "from denseface.capture.openni2._library import load\n"
            "for line in sys.stdin:\n"
            "    try:\n"
            f"        {opens}\n"
            "        print('open', flush=True)\n"
            "    except SensorError as error: print(error, flush=True)\n")
    with Control(tmp_path / "sensor", clip, serial="S1") as sensor, killed_at_the_end(
            subprocess.Popen(
                [sys.executable, "-c", code], env=environment(controls=[sensor]), cwd=REPOSITORY,
                text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)) as process:
        said = []
        for fault in (OpenFault.BUSY, OpenFault.BUSY, OpenFault.NONE, OpenFault.NONE):
            sensor.open_fault = fault
            process.stdin.write("again\n")
            process.stdin.flush()
            said.append(process.stdout.readline().strip())
        process.stdin.close()
        assert process.wait(LIMIT_S) == 0
    assert said == [busy, busy, "open", "open"]


@pytest.mark.parametrize("uri", ["nothing", "ä", "/dev/null"])
def test_another_sensor_than_those_found(clip, uri):
    _, error = failing(f"openni2:{uri}", environment(clip))
    assert error == (f"denseface.capture.errors.SensorError: openni2:{uri}: no such sensor; "
                     "found: virtual:0")


def test_a_missing_library(tmp_path):
    env = environment() | {"OPENNI2_REDIST": str(tmp_path)}
    _, error = failing("openni2:", env)
    assert error == (f"denseface.capture.errors.DriverError: OPENNI2_REDIST={tmp_path}: "
                     "no libOpenNI2.so in that folder")


def test_nothing_is_printed_and_no_folder_left(clip, tmp_path):
    code = ("from denseface.capture import open_source\n"
            "with open_source('openni2:') as source: next(iter(source))")
    done = run_python(code, env=environment(clip), cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert list(tmp_path.iterdir()) == []


def test_a_forked_process_is_refused(clip):
    code = ("import os\nfrom denseface.capture import open_source\n"
            "from denseface.capture.errors import SensorError\n"
            "source = open_source('openni2:')\n"
            "if os.fork() == 0:\n"
            "    try: open_source('openni2:')\n"
            "    except SensorError as error: print(error, flush=True)\n"
            "    os._exit(0)\n"
            "os.wait()\nsource.close()")
    done = run_python(code, env=environment(clip))
    assert "loaded before this process was forked" in done.stdout
    assert done.returncode == 0
