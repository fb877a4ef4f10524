"""`denseface status`."""

import argparse
import json
import time
from typing import TYPE_CHECKING

from denseface.service.commands import options
from denseface.service.commands.press import seconds

if TYPE_CHECKING:
    from denseface.service.protocol.messages import Status

__all__ = ["add_arguments", "run"]

_POLL_S = 0.1
_TIMEOUT_S = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    options.add_address(parser)
    options.add_credentials(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--wait", type=seconds, metavar="SECONDS",
                        help="wait until hub, a sensor and a worker are ready; fail where they "
                             "are not in this time")


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from denseface.service.errors import ClientTimeoutError

    deadline = time.monotonic() + (args.wait or 0)
    with options.client(args) as client:
        status = client.status(timeout=args.wait or _TIMEOUT_S)
        while args.wait is not None and not status.ready:
            left = deadline - time.monotonic()
            if left <= 0:
                missing = "no sensor" if not status.sensors else "no worker"
                raise ClientTimeoutError(f"{missing} is ready after {args.wait:g} s")
            time.sleep(min(_POLL_S, left))
            status = client.status(timeout=_TIMEOUT_S)
    if args.json:
        shown = status.model_dump(mode="json", exclude={"kind", "version", "request"})
        print(json.dumps({"address": client.address, "ready": status.ready} | shown))
    else:
        for name, value in _rows(client.address, status).items():
            print(f"{name:8} {value}")
    return 0


def _rows(address: str, status: "Status") -> dict[str, str]:
    rows = {
        "hub": f"{status.hub_version} at {address}",
        "sensors": ", ".join(status.sensors) or "none",
        "workers": ", ".join(status.workers) or "none",
        "now": f"{status.pressed} pressed, {status.queued} queued, {status.working} working",
        "kept": f"{status.done} faces, {status.failed} without a face, {status.dead} given up",
    }
    if status.free_bytes is not None:
        rows["disk"] = f"{status.free_bytes / 1e9:.1f} GB free"
        if status.kept_bytes is not None:
            rows["disk"] += f", {status.kept_bytes / 1e6:.1f} MB kept"
    if times := status.latencies.get("press_to_published"):
        rows["time"] = (f"{times.median_s:.2f} s from press to outcome, 99 % within "
                        f"{times.p99_s:.2f} s (of {times.count} since the start)")
    for name, counts in (("since", status.since_start), ("presses", status.presses_refused),
                         ("refused", status.refused)):
        if counts:
            what = {"since": "the start: ", "presses": "refused: "}.get(name, "")
            rows[name] = what + ", ".join(f"{one} {count}" for one, count in counts.items())
    return rows
