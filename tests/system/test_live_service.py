"""A live sensor that fails, and the service: what the presser hears, and how all comes back."""

import re
from contextlib import contextmanager

import pytest

from denseface.service.client import Client, Operator
from denseface.service.errors import PressRefusedError, RequestFailedError
from tests.nursery import Forked
from tests.system.running import REPOSITORY, hub_alone, service
from tests.virtual_sensor.control import Call, Control, OpenFault
from tests.virtual_sensor.process import environment, run_python
from tests.virtual_sensor.scenes import cheap_clip
from tests.waiting import LIMIT_S, until


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Depth and colour of one scene: a press is refused where they do not belong together."""
    return cheap_clip(tmp_path_factory.mktemp("clip") / "clip")


@pytest.fixture
def control(clip, tmp_path):
    with Control(tmp_path / "control", clip, marks=True) as control:
        yield control


@pytest.fixture
def hub(tmp_path):
    """A hub without workers: a press is accepted when its frame is safe."""
    address = f"ipc://{tmp_path}/h"
    with hub_alone(address, tmp_path / "data"):
        yield address


@contextmanager
def capture_process(address, control, log):
    """Run the capture process alone, and give it."""
    with log.open("w") as stderr:
        process = Forked(
            ["-m", "denseface", "capture", "--source", "openni2:", "--address", address],
            cwd=REPOSITORY, stderr=stderr, env=environment(controls=[control]))
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def pressed(client):
    """Press, and give the reason of a refusal; empty where the press was accepted."""
    try:
        client.press(timeout=LIMIT_S)
    except PressRefusedError as error:
        return str(error)
    return ""


def hung_s(step, log):
    """Give for how long the driver hung when that was noticed, seconds."""
    return float(re.search(rf"the driver hangs \({step} for (\d+\.\d) s\)", log.read_text())[1])


def test_a_press_is_answered_though_the_stamps_are_below_zero(hub, control, tmp_path):
    """As of a clock that was set back: OpenNI2 gives them as numbers near 2**64."""
    for stream in (control.depth, control.color):
        stream.stamp_offset_us = -3_600_000_000
    with capture_process(hub, control, tmp_path / "log"), Client(hub) as client:
        until(lambda: not pressed(client))
        assert control.loads == 1


def test_the_reason_why_there_is_no_frame_reaches_the_presser(hub, control, tmp_path):
    control.plugged = False
    with capture_process(hub, control, tmp_path / "log"), Client(hub) as client:
        until(lambda: "OpenNI2 finds no sensor" in pressed(client))
        control.open_fault = OpenFault.BUSY
        control.replug()
        until(lambda: "cannot be opened" in pressed(client))
        control.open_fault = OpenFault.NONE
        until(lambda: not pressed(client))
        control.unplug()
        until(lambda: "was unplugged" in pressed(client))
        control.replug("virtual:7")
        until(lambda: not pressed(client))


def test_frames_and_previews_come_from_one_process_that_stays(hub, control, tmp_path):
    with capture_process(hub, control, tmp_path / "log") as process, Client(hub) as client:
        until(lambda: not pressed(client))
        for _ in range(2):
            control.unplug()
            until(lambda: pressed(client))
            control.replug()
            until(lambda: not pressed(client))
        assert process.poll() is None
        assert control.loads == 1


@pytest.mark.parametrize("call", [Call.STOP, Call.CLOSE])
def test_a_driver_that_hangs_when_it_is_closed_ends_the_process(hub, control, tmp_path, call):
    log = tmp_path / "log"
    with capture_process(hub, control, log) as process, Client(hub) as client:
        until(lambda: not pressed(client))
        control.hang = call
        control.unplug()
        assert process.wait(LIMIT_S) == 1
    assert hung_s("closing", log) >= 2


@pytest.mark.parametrize("call", [Call.DESTROY_STREAM, Call.SHUTDOWN])
def test_a_driver_that_hangs_does_not_keep_the_process_at_its_end(hub, control, tmp_path, call):
    with capture_process(hub, control, tmp_path / "log") as process, Client(hub) as client:
        until(lambda: not pressed(client))
        control.hang = call
        process.terminate()
        process.wait(LIMIT_S)


def test_a_driver_that_hangs_when_it_is_opened_ends_the_process(hub, control, tmp_path):
    control.hang = Call.OPEN
    with capture_process(hub, control, tmp_path / "log") as process:
        assert process.wait(LIMIT_S) == 1
    assert hung_s("opening", tmp_path / "log") >= 10


def test_a_process_alone_that_is_told_to_restart_opens_its_source_again(hub, control, tmp_path):
    with capture_process(hub, control, tmp_path / "log") as process, Operator(hub) as operator:
        until(lambda: not pressed(operator))
        operator.restart_sensor(operator.status().sensors[0], timeout=LIMIT_S)
        until(lambda: control.opens == 2 and not pressed(operator))
        assert process.poll() is None
        with pytest.raises(RequestFailedError, match="no sensor attic is connected; there: "):
            operator.restart_sensor("attic", timeout=LIMIT_S)


def test_the_service_brings_back_a_sensor_whose_driver_hung_or_that_an_operator_restarts(
        control, tmp_path):
    with service("openni2:", tmp_path / "data",
                 environment=environment(controls=[control])) as up, up.client() as client:
        until(lambda: not pressed(client))
        control.hang = Call.CLOSE
        control.unplug()
        control.wait_hanging(Call.CLOSE)
        until(lambda: control.loads >= 2)
        control.hang = Call.NONE
        control.replug()
        until(lambda: not pressed(client))
        loads = control.loads
        with Operator(up.address) as operator:
            operator.restart_sensor(operator.status().sensors[0], timeout=LIMIT_S)
        until(lambda: control.loads == loads + 1)
        until(lambda: not pressed(client))
        assert client.status().restarts["capture"].exited >= 1


@pytest.mark.parametrize("call", [Call.CLOSE, Call.SHUTDOWN])
def test_a_program_that_read_a_sensor_ends_though_the_driver_hangs(control, call):
    """Any command that opens a sensor, not only the service."""
    control.hang = call
    done = run_python(
        "from denseface.capture import open_source\n"
        "source = open_source('openni2:')\n"
        "print(next(iter(source)).depth.shape, flush=True)",
        env=environment(controls=[control]))
    assert done.stdout == "(480, 640)\n"
    assert done.stderr == ("denseface: OpenNI2 or its driver hangs; ended without it after 6 s\n")
    assert done.returncode == 1
