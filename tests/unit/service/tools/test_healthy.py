"""What is told to whoever watches one part of the service."""

import socket

import pytest

from denseface.service.protocol.status import Compiling, SensorStatus
from denseface.service.tools.healthy import what_ails
from tests.unit.service.tools.test_status import Client, status

HERE = f"{socket.gethostname()}/1"
STREAMS = SensorStatus(name="a", state="streaming")
GONE = SensorStatus(name="b", state="absent", reason="unplugged")


def of(part, *sensors, **more):
    return what_ails(Client(status(*sensors, **more)), part)


@pytest.mark.parametrize("part", ["service", "hub", "sensor", "sensor:a", "worker"])
def test_all_is_well(part):
    assert of(part, "a", workers=(HERE,), sensor_states=(STREAMS, GONE)) == ""


def test_a_hub_alone_is_well_and_the_service_is_not():
    assert of("hub") == ""
    assert of("service").startswith("no sensor is ready: no capture process has come yet")
    assert of("sensor").startswith("no sensor is ready: no capture process has come yet")
    assert of("worker") == f"no worker of {socket.gethostname()} is ready"


def test_a_service_without_a_worker_says_what_it_waits_for():
    compiling = (Compiling(name=HERE, done=12, total=63),)
    assert of("service", "a", compiling=compiling) == (
        "no worker is ready: a worker compiles its kernels, 12 of 63")
    assert of("worker", compiling=compiling).endswith(
        "is ready: a worker compiles its kernels, 12 of 63")


def test_a_worker_elsewhere_is_not_this_machine_s():
    assert of("worker", workers=("elsewhere/1",)) == f"no worker of {socket.gethostname()} is ready"
    assert of("service", "a", workers=("elsewhere/1",)) == ""


def test_one_sensor_is_asked_for_by_its_name():
    assert of("sensor:b", sensor_states=(STREAMS, GONE)) == "b is absent: unplugged"
    assert of("sensor:c", sensor_states=(STREAMS, GONE)) == "the hub knows no sensor c"


@pytest.mark.parametrize("state", ["opening", "rebuilding"])
@pytest.mark.parametrize("part", ["hub", "sensor", "worker"])
def test_a_hub_that_does_not_serve_yet(part, state):
    assert of(part, "a", workers=(HERE,), state=state) == f"the hub is {state}"


def test_a_full_queue_is_no_fault_of_the_hub_and_a_disk_is():
    assert of("hub", obstacle="queue") == ""
    assert of("hub", obstacle="disk") == "presses are refused (disk)"
    assert of("service", obstacle="queue") == "presses are still refused (queue)"
