"""Waiting for what other threads and processes do."""

import math
import os
import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["LIMIT_MS", "LIMIT_S", "PATIENCE", "SERVICE", "until"]

_T = TypeVar("_T")


def _patience() -> float:
    text = os.environ.get("DENSEFACE_TEST_PATIENCE", "1")
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 1 <= factor <= 60:
        raise ValueError(f"DENSEFACE_TEST_PATIENCE={text!r}: expected a number from 1 to 60")
    return factor


PATIENCE = _patience()
"""How much slower than an idle machine this one may be: DENSEFACE_TEST_PATIENCE, or 1."""

LIMIT_S = 60.0 * PATIENCE
"""Seconds to wait for what is to come about. Only a failure takes as long."""
LIMIT_MS = round(LIMIT_S * 1000)
"""The same in milliseconds."""


SERVICE = {
    "DENSEFACE_LIVENESS": f"{min(3 * PATIENCE, 100):.0f}",
    "DENSEFACE_TAKE_TIMEOUT_S": f"{10 * PATIENCE:g}",
    "DENSEFACE_JOB_TIMEOUT_S": f"{60 * PATIENCE:g}",
    "DENSEFACE_HANG_TIMEOUT_S": f"{30 * PATIENCE:g}",
} if PATIENCE > 1 else {}
"""The service's own defaults, scaled: set for all tests but those of these very time-outs."""


def until(true: Callable[[], _T], within_s: float = LIMIT_S) -> _T:
    """Look again and again until something is so, and give it."""
    deadline = time.monotonic() + within_s
    while not (found := true()):
        assert time.monotonic() < deadline, "did not come about"
        time.sleep(0.02)
    return found
