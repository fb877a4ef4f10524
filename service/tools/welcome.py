"""What `denseface up` says on a terminal when presses can be made: what to type next."""

import shlex
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from denseface.service.client import Client
from denseface.service.errors import ClientTimeoutError, ServiceError
from denseface.service.runtime.terminal import complain
from denseface.service.settings import default_address

__all__ = ["next_steps", "welcoming"]

_LOOK_S = 0.5
"""Time between two looks at the hub, seconds."""
_ANSWER_S = 1.0
"""Longest wait for its answer, seconds: so long the end may be held up."""


def next_steps(address: str, page: str) -> list[str]:
    """Give the lines; `page` is the address of the page for visitors, empty where there is none."""
    where = "" if address == default_address() else f" --address {shlex.quote(address)}"
    lines = ["ready; in another terminal:",
             f"  denseface press --save face.ply{where}    take a picture now",
             f"  denseface status{where}    who is connected, what was done"]
    if page:
        lines.append(f"the page for visitors: {page}")
    return [*lines, "Ctrl-C ends the service"]


@contextmanager
def welcoming(address: str, lines: Sequence[str], look_s: float = _LOOK_S) -> Iterator[None]:
    """Say the lines on stderr when hub, a sensor and a worker are ready, within the block."""
    ended = threading.Event()
    thread = threading.Thread(
        target=_watch, args=(address, lines, look_s, ended), name="welcome", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _watch(address: str, lines: Sequence[str], look_s: float, ended: threading.Event) -> None:
    with suppress(ServiceError, OSError), Client(address) as client:
        while not ended.wait(look_s):
            with suppress(ClientTimeoutError):
                if client.status(timeout=_ANSWER_S).ready:
                    for line in lines:
                        complain(line)
                    return
