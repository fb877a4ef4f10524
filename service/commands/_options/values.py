"""Values of flags: each is checked, and refused in the words `expected ..., found ...`."""

import argparse
import math
import re
from collections.abc import Callable
from datetime import datetime

from denseface.validation import PEER_NAME, TEXT_OF_PATTERN

__all__ = ["burst", "count", "file_mode", "millimetres", "part", "percent", "print_height",
           "seconds", "sensor_name", "timestamp", "wall", "wanted", "whole"]

_MOST = 10**12
"""Largest whole number that anything takes."""
_DAY_S = 86400.0
"""Longest time that is waited, seconds."""
_SHOWN = 60
"""Characters of a wrong value that are shown."""


def wanted(expected: str, found: str) -> argparse.ArgumentTypeError:
    """Give the error of a value: one line that says both."""
    shown = found if len(found) <= _SHOWN else found[:_SHOWN] + "..."
    return argparse.ArgumentTypeError(f"expected {expected}, found {shown!r}")


def whole(least: int, most: int = _MOST) -> Callable[[str], int]:
    """Give what reads a whole number in these bounds."""
    expected = (f"a whole number, at least {least}" if most == _MOST
                else f"a whole number from {least} to {most}")

    def read(text: str) -> int:
        if (not re.fullmatch("[+-]?[0-9]+", text) or len(text) > len(str(_MOST)) + 1
                or not least <= (value := int(text)) <= most):
            raise wanted(expected, text)
        return value

    return read


count = whole(1)


def seconds(text: str) -> float:
    """Read a time to wait, seconds."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value <= _DAY_S:
        raise wanted(f"seconds, more than 0 and at most {_DAY_S:.0f}", text)
    return value


def percent(text: str) -> float:
    """Read a confidence."""
    return _between(text, 50.0, 99.9, "a percentage from 50 to 99.9")


def millimetres(text: str) -> float:
    """Read a length on a face."""
    return _between(text, 0.01, 100.0, "millimetres, 0.01 to 100")


def wall(text: str) -> float:
    """Read a thickness as `Printing` takes it."""
    from denseface.service.export.printing.choice import WALL_MM

    return _between(text, *WALL_MM, "millimetres from {:g} to {:g}".format(*WALL_MM))


def print_height(text: str) -> float:
    """Read a height as `Printing` takes it."""
    from denseface.service.export.printing.choice import HEIGHT_MM

    return _between(text, *HEIGHT_MM, "millimetres from {:g} to {:g}".format(*HEIGHT_MM))


def _between(text: str, least: float, most: float, expected: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise wanted(expected, text)
    return value


def burst(text: str) -> int:
    """Read a number of frames that can be made one."""
    from denseface.capture import MAX_BURST

    return whole(1, MAX_BURST)(text)


def sensor_name(text: str) -> str:
    """Read the name of a sensor, as a hub takes it."""
    if not re.fullmatch(PEER_NAME, text):
        raise wanted(TEXT_OF_PATTERN[PEER_NAME], text)
    return text


_PARTS = ("service", "hub", "sensor", "worker", "kiosk")
_NAMED = "sensor:"


def part(text: str) -> str:
    """Read a part of the service, of one sensor as `sensor:NAME`."""
    if text not in _PARTS and not (text.startswith(_NAMED)
                                   and re.fullmatch(PEER_NAME, text.removeprefix(_NAMED))):
        raise wanted(f"one of {', '.join(_PARTS)}, or sensor:NAME", text)
    return text


def timestamp(text: str) -> datetime:
    """Read a time; UTC where it names no zone."""
    from denseface.service.runtime.parsing import parse_time

    try:
        return parse_time(text)
    except ValueError:
        raise wanted("a time such as 2026-01-31T14:30, UTC or with a zone", text) from None


def file_mode(text: str) -> int:
    """Read the mode of a file that its owner can read and write."""
    if not re.fullmatch("0?[0-7]{3}", text) or (mode := int(text, 8)) & 0o600 != 0o600:
        raise wanted("three octal digits such as 640, the first a 6 or 7", text)
    return mode
