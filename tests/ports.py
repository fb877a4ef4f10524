"""Ports for hubs under test."""

import errno
import random
import socket
from pathlib import Path

__all__ = ["free_port"]

_RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
_LOWEST = 10_000


def free_port(host: str = "127.0.0.1") -> int:
    """Give a port that is free with the next one, which a hub publishes on.

    It is none of those that the system gives to outgoing connections, nor half of another pair that
    this gives: until the hub has bound, nobody else gets it by the way.
    """
    highest = max(int(_RANGE.read_text().split()[0]), 2 * _LOWEST)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for _ in range(100):
        port = random.SystemRandom().randrange(_LOWEST, highest - 1, 2)
        with socket.socket(family) as one, socket.socket(family) as two:
            try:
                one.bind((host, port))
                two.bind((host, port + 1))
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    raise
            else:
                return port
    raise AssertionError(f"{host}: no two free ports")
