"""Waiting for what other threads and processes do."""

import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["until"]

_T = TypeVar("_T")


def until(true: Callable[[], _T], within_s: float = 30.0) -> _T:
    """Look again and again until something is so, and give it."""
    deadline = time.monotonic() + within_s
    while not (found := true()):
        assert time.monotonic() < deadline, "did not come about"
        time.sleep(0.02)
    return found
