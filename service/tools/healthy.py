"""Whether one part of the service is well, for whoever watches it from outside."""

import socket

from denseface.service.client import Client
from denseface.service.protocol.messages import Status
from denseface.service.tools.status import why_no_sensor, why_not_ready

__all__ = ["what_ails"]

_NAMED = "sensor:"
_ANSWER_S = 5.0
"""Longest wait for the hub, seconds."""


def what_ails(client: Client, part: str) -> str:
    """Say what is wrong with a part; empty where nothing is.

    Parameters
    ----------
    part : `service`, where a press now would become a face; `hub`, where presses are taken;
        `sensor`, where any gives frames, or `sensor:NAME`, where that one does; `worker`, where one
        of this machine is ready

    Raises
    ------
    ClientTimeoutError
        No hub answers.
    """
    status = client.status(timeout=_ANSWER_S)
    if part == "service":
        return "" if status.ready else why_not_ready(status)
    if status.state != "serving":
        return f"the hub is {status.state}"
    if part == "hub":
        # One that has as many frames as it may keep waiting is well.
        return f"presses are refused ({status.obstacle})" if status.obstacle == "disk" else ""
    return _worker(status) if part == "worker" else _sensor(status, part.removeprefix(_NAMED))


def _sensor(status: Status, name: str) -> str:
    if name == "sensor":
        return "" if status.has_frames else f"no sensor is ready: {why_no_sensor(status)}"
    for one in status.sensor_states:
        if one.name == name:
            well = one.state in ("streaming", "warming")
            return "" if well else f"{one.name} is {one.state}{one.reason and f': {one.reason}'}"
    return f"the hub knows no sensor {name}"


def _worker(status: Status) -> str:
    host = socket.gethostname()
    if any(one.partition("/")[0] == host for one in status.workers):
        return ""
    return f"no worker of {host} is ready{status.kernels and f': {status.kernels}'}"
