"""Durations, times and addresses as people write them."""

import math
import re
from datetime import UTC, datetime
from ipaddress import ip_address

__all__ = ["parse_address", "parse_loopback_address", "parse_retention", "parse_time"]

_UNITS = {"": 1, "s": 1, "m": 60, "h": 3600, "d": 86400}
"""Letter -> seconds."""
_SHORTEST_S = 1.0
"""Shortest retention, seconds: 0 may mean "keep nothing" or "no limit"."""


def parse_retention(given: object) -> float | None:
    """Read a retention, seconds; None for `off`.

    Raises
    ------
    ValueError
        One line that says what was expected.
    """
    text = str(given).strip()
    if given is None or text.lower() == "off":
        return None
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([smhd]?)", text)
    seconds = float(match[1]) * _UNITS[match[2]] if match else math.nan
    if not _SHORTEST_S <= seconds < math.inf:
        raise ValueError("expected a time of 1 s or more such as 24h, 90m or 7d, or off")
    return seconds


def parse_time(text: str) -> datetime:
    """Read an ISO 8601 time; UTC where it names no zone.

    Raises
    ------
    ValueError
        One line that says what was expected.
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(
            f"{text!r}: expected a time such as 2026-01-31T14:30, UTC or with a zone") from error
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


def parse_address(given: object) -> tuple[str, int] | None:
    """Read `PORT` (of 127.0.0.1) or `HOST:PORT` with an IP address; None for `off`.

    Port 0 is any free one.

    Raises
    ------
    ValueError
        One line that says what was expected.
    """
    text = str(given).strip()
    if given is None or text.lower() == "off":
        return None
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]") if colon else "127.0.0.1"
    try:
        ip_address(host)
    except ValueError:
        port = ""
    if not port.isascii() or not port.isdecimal() or len(port) > 5 or int(port) > 65535:
        raise ValueError("expected PORT, or an IP address and a port such as 127.0.0.1:8080 or "
                         "[::1]:8080, or off")
    return host, int(port)


def parse_loopback_address(given: object) -> tuple[str, int] | None:
    """Read an address as `parse_address`, of a loopback host.

    Raises
    ------
    ValueError
        One line that says what was expected.
    """
    try:
        address = parse_address(given)
        loopback = address is None or ip_address(address[0]).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise ValueError("expected PORT, 127.0.0.1:PORT or [::1]:PORT, or off: the metrics are for "
                         "this machine alone")
    return address
