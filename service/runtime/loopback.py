"""Places that only this machine reaches."""

from ipaddress import ip_address

__all__ = ["loopback_place"]


def loopback_place(given: object) -> tuple[str, int] | None:
    """Read `PORT` or `HOST:PORT` of a loopback host; None for `off`. Port 0 is any free one.

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
        loopback = ip_address(host).is_loopback
    except ValueError:
        loopback = False
    if not loopback or not port.isascii() or not port.isdecimal() or not int(port) <= 65535:
        raise ValueError("expected PORT, 127.0.0.1:PORT or [::1]:PORT, or off: the metrics are for "
                         "this machine alone")
    return host, int(port)
