"""The hub's status: waited for until a press would become a face, and as text or JSON."""

import json
import time

from denseface.service.client import Client
from denseface.service.errors import ClientTimeoutError
from denseface.service.protocol.messages import Status
from denseface.service.protocol.status import Restarts, SensorStatus
from denseface.service.runtime.terminal import printable

__all__ = ["as_json", "as_text", "ready_status", "why_no_sensor", "why_not_ready"]

_POLL_S = 0.1
"""Time between two requests, seconds."""
_HELP = "`denseface doctor` says what keeps a sensor from working"


def ready_status(client: Client, timeout: float) -> Status:
    """Wait until hub, a sensor and a worker are ready, at most `timeout` seconds.

    The time in which kernels are compiled is not counted: it comes once on a machine.

    Raises
    ------
    ClientTimeoutError
        One line that says what is missing.
    """
    looked = time.monotonic()
    deadline = looked + timeout
    status = client.status(timeout=timeout)
    while not status.ready:
        now = time.monotonic()
        if status.compiling and not status.workers:
            deadline += now - looked
        looked = now
        left = deadline - now
        if left <= 0:
            raise ClientTimeoutError(why_not_ready(status, f" after {timeout:g} s"))
        time.sleep(min(_POLL_S, left))
        status = client.status()
    return status


def why_not_ready(status: Status, after: str = "") -> str:
    """Say what is missing for a press to become a face; `after` is said of the time until now."""
    if status.obstacle:
        return f"presses are still refused ({status.obstacle}){after}"
    if status.state != "serving":
        return f"no hub is ready{after}"
    if status.has_frames:
        return f"no worker is ready{after}{status.kernels and f': {status.kernels}'}"
    help_ = f"; {_HELP}" if _is_sensor_wrong(status) else ""
    return f"no sensor is ready{after}: {why_no_sensor(status)}{help_}"


def why_no_sensor(status: Status) -> str:
    """Say why there is none: as the sensors say, or as their processes ended."""
    if status.sensor_states:
        return "; ".join(f"{one.name} is {one.state}{one.reason and f': {one.reason}'}"
                         for one in status.sensor_states)
    return "; ".join(
        f"the process {name} ended {one.exited + one.hung} times and is started again, last ended "
        f"by {one.last}" for name, one in _ended_captures(status)) or (
        "no capture process has come yet: `denseface up` starts one, `denseface capture` is one")


def _ended_captures(status: Status) -> list[tuple[str, Restarts]]:
    return [(name, one) for name, one in status.restarts.items() if name.startswith("capture")]


def _is_sensor_wrong(status: Status) -> bool:
    """Whether a look at the sensor may help: one that is being opened is to be waited for."""
    return (status.state == "serving" and not status.has_frames
            and not any(one.state == "opening" for one in status.sensor_states)
            and bool(status.sensor_states or _ended_captures(status)))


def _sensor(one: SensorStatus) -> str:
    """Say of a sensor how it is, and what went wrong since its process began."""
    figures = one.figures
    identity = f" ({one.identity})" if one.identity not in ("", one.name) else ""
    state = f"{one.state}{one.reason and f': {one.reason}'}"
    counts = {"frames": figures.frames, "dropped": figures.drops, "stalls": figures.stalls,
              "reconnects": figures.reconnects, "of a wrong size": figures.wrong_size}
    counted = "".join(f", {count} {name}" for name, count in counts.items() if count)
    skew = f", skew {figures.skew_us / 1000:.1f} ms" if figures.skew_us else ""
    return f"{one.name}{identity} {state}{counted}{skew}"


def as_json(address: str, status: Status) -> str:
    """Give the status as one JSON object."""
    fields = status.model_dump(mode="json", exclude={"kind", "version", "request"})
    return json.dumps({"address": address, "ready": status.ready} | fields)


def as_text(address: str, status: Status) -> str:
    """Give the status as lines of a name and what it says, escaped."""
    rows = {
        "hub": f"{status.hub_version} at {address}",
        "sensors": "; ".join(map(_sensor, status.sensor_states)) or (
            ", ".join(status.sensors) or f"none: {why_no_sensor(status)}"
            if status.state == "serving" else "none"),
        "workers": "; ".join(filter(None, [", ".join(status.workers), status.kernels])) or "none",
        "now": f"{status.pressed} pressed, {status.queued} queued, {status.working} working",
        "kept": f"{status.done} faces, {status.failed} without a face, {status.dead} given up",
    }
    if _is_sensor_wrong(status):
        rows["help"] = _HELP
    if status.free_bytes is not None:
        rows["disk"] = f"{status.free_bytes / 1e9:.1f} GB free"
        if status.kept_bytes is not None:
            rows["disk"] += f", {status.kept_bytes / 1e6:.1f} MB kept"
    if status.obstacle:
        rows["now"] += f"; presses are refused: {status.obstacle}"
    if times := status.latencies.get("press_to_published"):
        rows["time"] = (f"{times.median_s:.2f} s from press to outcome, 99 % within "
                        f"{times.p99_s:.2f} s (of {times.count} since the start)")
    for name, prefix, counts in (
            ("since", "the start: ", status.since_start),
            ("presses", "refused: ", status.presses_refused),
            ("refused", "", status.refused)):
        if counts:
            rows[name] = prefix + ", ".join(f"{one} {count}" for one, count in counts.items())
    if status.restarts:
        rows["restarts"] = ", ".join(
            f"{process} {reason} {count}" for process, counts in status.restarts.items()
            for reason, count in (("exited", counts.exited), ("hung", counts.hung)) if count)
    if status.state != "serving":
        rows["hub"] += (f", {status.state}: {status.files_read} of {status.files_to_read} files "
                        "read, all else is not known yet")
    if status.log_lines_lost:
        rows["log"] = f"{status.log_lines_lost} lines of the hub's lost"
    return "\n".join(f"{name:8} {printable(value)}" for name, value in rows.items())
