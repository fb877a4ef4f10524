"""`denseface status`."""

import argparse
import time

from service.commands import options
from service.commands.press import seconds

__all__ = ["add_arguments", "run"]

_POLL_S = 0.1
_TIMEOUT_S = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    options.add_address(parser)
    options.add_credentials(parser)
    parser.add_argument("--wait", type=seconds, metavar="SECONDS",
                        help="wait until hub, a sensor and a worker are ready; fail where they "
                             "are not in this time")


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from service.errors import ClientTimeoutError

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
    rows = {
        "hub": f"{status.hub_version} at {client.address}",
        "sensors": ", ".join(status.sensors) or "none",
        "workers": ", ".join(status.workers) or "none",
        "now": f"{status.pressed} pressed, {status.queued} queued, {status.working} working",
        "kept": f"{status.done} faces, {status.failed} without a face, {status.dead} given up",
    }
    if status.refused:
        rows["refused"] = ", ".join(f"{reason} {count}" for reason, count in
                                    status.refused.items())
    for name, value in rows.items():
        print(f"{name:8} {value}")
    return 0
