"""The hub's status as its users see it."""

import json
from types import SimpleNamespace

import pytest

from denseface.service.errors import ClientTimeoutError
from denseface.service.protocol.messages import Status
from denseface.service.protocol.sensor_messages import SensorFigures
from denseface.service.protocol.status import Compiling, SensorStatus
from denseface.service.tools import status as module
from denseface.service.tools.status import as_json, as_text, ready_status


def status(*sensors, workers=(), **more):
    return Status(request=1, epoch="e", sequence=0, hub_version="1", sensors=sensors,
                  workers=workers, pressed=0, queued=0, working=0, done=2, failed=1, dead=0,
                  kept_bytes=None, free_bytes=None, **more)


class Client:
    """Answers with one status after the other; the last one stays."""

    def __init__(self, *answers):
        self.answers = list(answers)

    def status(self, **_):
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


def test_it_is_waited_for_until_a_press_would_become_a_face(monkeypatch):
    monkeypatch.setattr(module, "_POLL_S", 0.0)
    ready = status("s", workers=("w",))
    assert ready_status(Client(status(), status("s"), ready), 60) is ready


@pytest.mark.parametrize(("last", "missing"), [(status(), "sensor"), (status("s"), "worker")])
def test_what_is_missing_at_the_end_is_named(last, missing):
    with pytest.raises(ClientTimeoutError, match=f"no {missing} is ready after 0.01 s"):
        ready_status(Client(last), 0.01)


COMPILING = status("s", compiling=[Compiling(name="w", done=12, total=63)])


def test_the_time_in_which_kernels_are_compiled_does_not_count(monkeypatch):
    clock = iter(range(1000))
    monkeypatch.setattr(module, "time", SimpleNamespace(
        monotonic=lambda: 100 * next(clock), sleep=lambda _: None))
    ready = status("s", workers=("w",))
    assert ready_status(Client(*[COMPILING] * 50, ready), 60) is ready
    with pytest.raises(ClientTimeoutError, match="no worker is ready after 60 s"):
        ready_status(Client(status("s")), 60)


def test_a_worker_that_compiles_is_told_with_how_far_it_is():
    assert "workers  a worker compiles its kernels, 12 of 63" in as_text("ipc:///x", COMPILING)
    others = [Compiling(name=name, done=done, total=63) for name, done in (("b", 0), ("c", 40))]
    several = status("s", workers=("a",), compiling=others)
    assert "workers  a; 2 workers compile their kernels, 40 of 63" in as_text("ipc:///x", several)


def test_what_refuses_every_press_is_said():
    full = status("s", workers=("w",), obstacle="disk")
    with pytest.raises(ClientTimeoutError, match=r"presses are still refused \(disk\) after 0.01"):
        ready_status(Client(full), 0.01)
    assert "; presses are refused: disk" in as_text("ipc:///x", full)


def test_json_and_text_say_the_same():
    shown = status("s")
    said = json.loads(as_json("ipc:///x", shown))
    assert (said["address"], said["ready"], said["sensors"], said["done"]) == (
        "ipc:///x", False, ["s"], 2)
    assert as_text("ipc:///x", shown).splitlines() == [
        "hub      1 at ipc:///x", "sensors  s", "workers  none",
        "now      0 pressed, 0 queued, 0 working",
        "kept     2 faces, 1 without a face, 0 given up"]


def test_sensors_are_told_with_their_states_and_what_went_wrong():
    states = (SensorStatus(name="B0012", state="streaming", identity="B0012",
                           figures=SensorFigures(frames=5400, drops=12, stalls=2, skew_us=12400)),
              SensorStatus(name="door", state="blocked", reason="no permission for /dev/bus/usb",
                           identity="usb 1-2"))
    assert as_text("ipc:///x", status("B0012", sensor_states=states)).splitlines()[1] == (
        "sensors  B0012 streaming, 5400 frames, 12 dropped, 2 stalls, skew 12.4 ms; "
        "door (usb 1-2) blocked: no permission for /dev/bus/usb")
    with pytest.raises(ClientTimeoutError, match=(
            r"no sensor is ready after 0\.01 s: door is blocked: no permission for /dev/bus/usb; "
            "`denseface doctor` says what keeps a sensor from working")):
        ready_status(Client(status(sensor_states=states[1:])), 0.01)


HELP = "help     `denseface doctor` says what keeps a sensor from working"


@pytest.mark.parametrize(("more", "words", "helps"), [
    ({}, "none: no capture process has come yet: `denseface up` starts one, `denseface capture` is "
         "one", False),
    ({"restarts": {"worker-1": {"exited": 1, "last": "SIGKILL"}}}, "none: no capture proc", False),
    ({"restarts": {"capture": {"exited": 2, "hung": 1, "last": "status 1: no such class"}}},
     "none: the process capture ended 3 times and is started again, last ended by status 1: no "
     "such class", True),
    ({"sensor_states": [{"name": "s", "state": "absent", "reason": "OpenNI2 finds no sensor"}]},
     "s absent: OpenNI2 finds no sensor", True),
    ({"sensor_states": [{"name": "s", "state": "opening", "reason": "the source is being opened"}]},
     "s opening: the source is being opened", False),
    ({"state": "opening"}, "none", False),
])
def test_why_there_is_no_sensor_and_what_helps(more, words, helps):
    shown = Status.model_validate(status().model_dump() | more)
    lines = as_text("ipc:///x", shown).splitlines()
    assert lines[1].startswith(f"sensors  {words}")
    assert (HELP in lines) is helps


def test_lost_lines_of_the_log_are_shown_and_names_obey_no_terminal():
    text = as_text("ipc:///x", status("s\x1b[2J\nkept").model_copy(update={"log_lines_lost": 3}))
    assert "log      3 lines of the hub's lost" in text.splitlines()
    assert r"sensors  s\x1b[2J\nkept" in text.splitlines()


def test_it_says_what_was_started_again_and_why():
    shown = status(restarts={"hub": {"hung": 1}, "worker-1": {"exited": 2, "hung": 3}})
    assert as_text("ipc:///x", shown).splitlines()[-1] == (
        "restarts hub hung 1, worker-1 exited 2, worker-1 hung 3")
    assert json.loads(as_json("ipc:///x", shown))["restarts"]["hub"] == {
        "exited": 0, "hung": 1, "last": ""}
