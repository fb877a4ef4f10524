"""The doctor's look through OpenNI2: what its sensors answer, or where one hangs or crashes."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from denseface.capture.identity import Identity, UsbDevice
from denseface.service.tools.doctor.findings import Finding, ok, problem, warning

__all__ = ["Answers", "ask", "look_at_frame", "look_at_list"]

LIMIT_S = 20.0
"""Time that a sensor has to open, send frames and close, seconds; loading takes 2 at most."""
_HANGS = "plug the sensor in again; if it repeats, another port or driver"
_ASLEEP = {"loading": "while OpenNI2 and its drivers are loaded", "opening": "while it is opened",
           "open": "before its first frames", "closing": "while it is closed",
           "closed": "when the program ends"}
"""Where a process ended without another word, by the last."""
_MOST_SKEW_MS = 17.0
"""Half a frame period at 30 frames a second: depth and colour of a moving face differ beyond."""
_LEAST_COVERAGE, _LEAST_BRIGHTNESS = 0.1, 20.0
"""Part of the depth image with a reading, and grey levels: an indoor scene has more."""

Answers = dict[str, dict[str, Any]]
"""What a process said, by the step, in order; the last may be `hung`, `crashed` or `error`."""


def ask(uri: str | None = None, limit_s: float = LIMIT_S) -> Answers:
    """Ask OpenNI2 for its sensors, or the one of a URI for a frame; see `questions`."""
    with subprocess.Popen(
            [sys.executable, "-P", "-m", "denseface.service.tools.doctor.questions",
             *([] if uri is None else [uri])],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, errors="replace") as process:
        hung = False
        try:
            out, err = process.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            hung = True
            process.kill()
            out, err = process.communicate()
    answers: Answers = {}
    for line in out.splitlines():
        answers |= _answer(line)
    last = next(reversed(answers), "loading")
    if last == "sensors":
        return answers  # some driver does not end well: each process that opens a sensor will say
    if hung:
        answers["hung"] = {"where": last, "seconds": limit_s}
    elif process.returncode:
        lines = err.strip().splitlines()
        answers["crashed"] = {"where": last, "how": lines[-1] if lines and process.returncode > 0
                              else _signal_name(-process.returncode)}
    return answers


def look_at_list(answers: Answers, devices: Sequence[UsbDevice]) -> Iterator[Finding]:
    """Say which sensors OpenNI2 lists, and which it should.

    Parameters
    ----------
    answers : of `ask`, without a URI
    devices : what Linux sees
    """
    yield from _failures("OpenNI2", answers)
    if "library" in answers:
        yield ok("OpenNI2", f"version {answers['library']['version']}")
    if "sensors" not in answers:
        return
    listed = listed_sensors(answers)
    for sensor in listed:
        yield ok("sensor", f"{sensor} is listed")
    ports = {sensor.usb_port for sensor in listed}
    missing = [device for device in devices if device.kind and device.port not in ports]
    # The URIs of some drivers do not say which device they are of.
    for device in missing[sum(not sensor.usb_port for sensor in listed):]:
        yield problem("sensor", f"OpenNI2 does not list the {device.kind} at USB {device.port}",
                      "see the problems above; else another program has it open: stop that")
    if not listed and not missing:
        yield problem("sensor", "OpenNI2 lists none", "plug it in, with its power supply")


def listed_sensors(answers: Answers) -> list[Identity]:
    """Give the sensors that OpenNI2 lists."""
    return [Identity(**sensor) for sensor in answers.get("sensors", {}).get("sensors", [])]


def look_at_frame(name: str, answers: Answers, serving: Sequence[str]) -> Iterator[Finding]:
    """Say what became of opening a sensor and taking a frame.

    Parameters
    ----------
    name : the sensor's, for messages, until it says itself what it is known as
    answers : of `ask`, with its URI
    serving : names of the sensors that the hub knows: they may be this one
    """
    if "error" in answers and "open" not in answers and serving:
        yield warning(name, answers["error"]["text"], "the running service may have it "
                      f"({', '.join(serving)}); to look at it, stop denseface up")
        return
    name = answers.get("open", {}).get("name", name)
    yield from _failures(name, answers)
    if (said := answers.get("open")) is not None:
        modes = ", ".join(f"{kind} {mode} (of {said['offered'].get(kind, 1)})"
                          for kind, mode in said["chosen"].items())
        alone = "" if "color" in said["chosen"] else ", no color camera"
        yield ok(name, f"{said['uri']}, {modes}{alone}")
    if (frame := answers.get("frame")) is None:
        return
    yield from _look_at_facts(name, frame)


def _look_at_facts(name: str, frame: dict[str, Any]) -> Iterator[Finding]:
    registered = "registered to color" if frame["registered"] else "not registered"
    text = f"depth in {frame['coverage']:.0%} of the image, {registered}"
    if frame["coverage"] < _LEAST_COVERAGE:
        yield problem(name, text, "point it at something 0.6 to 3 m away, out of the sun; nothing "
                      "may cover the projector")
    else:
        yield ok(name, text)
    if frame["skew_ms"] is not None:
        text = (f"depth and color {abs(frame['skew_ms']):.1f} ms apart"
                + (f", by {frame['skew_known_by']}" if frame["skew_known_by"] else ""))
        if abs(frame["skew_ms"]) > _MOST_SKEW_MS:
            yield warning(name, text, "another USB port; people are to hold still")
        else:
            yield ok(name, text)
        if frame["brightness"] < _LEAST_BRIGHTNESS:
            yield warning(name, f"the color image is dark ({frame['brightness']:.0f} of 255)",
                          "more light")
    yield ok(name, f"calibration: {frame['calibration']}")
    for note in frame["notes"]:
        yield warning(name, note, "another driver, or --calibration with what was measured")


def _failures(what: str, answers: Answers) -> Iterator[Finding]:
    if (error := answers.get("error")) is not None:
        yield problem(what, error["text"], "docs/operating.md, What the messages mean")
    if (hung := answers.get("hung")) is not None:
        where = _ASLEEP.get(hung["where"], f"after {hung['where']}")
        say = warning if hung["where"] == "closed" else problem
        yield say(what, f"hangs {where} (given up after {hung['seconds']:g} s)", _HANGS)
    if (crashed := answers.get("crashed")) is not None:
        where = _ASLEEP.get(crashed["where"], f"after {crashed['where']}")
        # All was answered then: the service ends such a process by itself.
        say = warning if crashed["where"] == "closed" else problem
        yield say(what, f"crashes {where}: {crashed['how']}", _HANGS)


def _answer(line: str) -> Answers:
    """Read one line; a driver may print others."""
    try:
        said = json.loads(line)
    except ValueError:
        return {}
    return {said.pop("step"): said} if isinstance(said, dict) and "step" in said else {}


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"status {-number}"
