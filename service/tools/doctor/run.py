"""Everything that the doctor looks at, one after the other."""

from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path

from denseface.capture.identity import USB_DEVICES, Identity, known_as, usb_devices
from denseface.service.client import Client
from denseface.service.errors import ServiceError, SettingsError
from denseface.service.protocol.messages import Status
from denseface.service.runtime.terminal import say
from denseface.service.tools.doctor.findings import (
    Finding,
    Level,
    as_json,
    as_lines,
    ok,
    problem,
    warning,
    worst,
)
from denseface.service.tools.doctor.machine import look_at_library, look_at_python, look_at_usb
from denseface.service.tools.doctor.sensor import (
    LIMIT_S,
    ask,
    listed_sensors,
    look_at_frame,
    look_at_list,
)

__all__ = ["run"]

_HUB_S = 3.0
"""Longest wait for the hub, seconds."""


def run(
    source: str | None, connect: Callable[[], Client], *, as_json_object: bool = False,
    usb_root: Path = USB_DEVICES, root: Path = Path("/"), limit_s: float = LIMIT_S,
    more: Iterable[Finding] = (),
) -> int:
    """Look at everything, print what was found and give the exit status: 1 with a problem.

    Parameters
    ----------
    source : the one sensor to be opened, as of `--source`; None for all that there are
    connect : makes the client to ask the hub with
    usb_root, root : instead of Linux's list of USB devices and `/`, for tests
    limit_s : longest time that a sensor has
    more : what is found elsewhere; told last
    """
    findings = []
    for finding in chain(_look(source, connect, usb_root, root, limit_s), more):
        findings.append(finding)
        if not as_json_object:
            say(*as_lines([finding]), flush=True)
    if as_json_object:
        say(as_json(findings))
    return int(worst(findings) is Level.PROBLEM)


def _look(
    source: str | None, connect: Callable[[], Client], usb_root: Path, root: Path, limit_s: float
) -> Iterator[Finding]:
    devices = usb_devices(usb_root)
    yield look_at_python()
    yield from look_at_library(devices)
    yield from look_at_usb(devices, root)
    hub, status = _ask_hub(connect)
    yield hub
    answers = ask(limit_s=limit_s)
    yield from look_at_list(answers, devices)
    sensors = listed_sensors(answers)
    if source is not None:
        name = source.partition(":")[2]
        chosen = known_as(name, sensors) or (Identity(name) if name else None)
        sensors = [chosen] if chosen else sensors[:1]
    serving = [] if status is None else [
        f"{sensor.name}: {sensor.state}" for sensor in status.sensor_states]
    for sensor in sensors:
        yield from look_at_frame(sensor.name, ask(sensor.uri, limit_s), serving)


def _ask_hub(connect: Callable[[], Client]) -> tuple[Finding, Status | None]:
    try:
        with connect() as client:
            status = client.status(timeout=_HUB_S)
            text = f"{status.hub_version} at {client.address}, {status.state}"
    except SettingsError as error:
        return problem("hub", str(error), "correct the flag or the variable of the address or "
                       "keys"), None
    except (ServiceError, OSError) as error:
        return warning("hub", str(error), "denseface up, as this user; or --address"), None
    if not status.sensors:
        return warning("hub", f"{text}, no sensor can be asked", "denseface status"), status
    return ok("hub", f"{text}, sensors: {', '.join(status.sensors)}"), status
