"""`denseface up`."""

import argparse
import os

from denseface.service.commands import capture, options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    capture.add_source(parser)
    parser.add_argument("--workers", type=_count, default=max(1, (os.cpu_count() or 2) - 1),
                        metavar="N", help="reconstruction processes (default: cores less one)")
    options.add_address(parser)
    options.add_listen(parser)
    options.add_hub(parser)
    options.add_retention(parser)
    options.add_metrics(parser)
    options.add_recon(parser)
    options.add_daemon(parser)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    options.start_daemon(args, "up")
    from denseface.service.daemons.supervisor import Supervisor, processes
    from denseface.service.errors import AddressError
    from denseface.service.storage.folder_lock import check_folder
    from denseface.service.transport.addresses import check_bindable, is_local
    from denseface.service.transport.listeners import server_credentials

    settings = options.service_settings(args)
    if not is_local(settings.address):
        raise AddressError(
            f"{settings.address}: the processes of `denseface up` meet at a local address; "
            f"--listen {settings.address} lets other machines in, with CURVE keys")
    check_bindable(settings.address)
    check_folder(settings.data)  # the hub would say so too, but later, among others
    if settings.listen:
        server_credentials(settings)  # the hub would say so too, but later
    changed = options.recon_arguments(args)
    options.recon_settings(args)
    common = ["--address", settings.address, "--log", args.log]
    if args.debug:
        common.append("--debug")
    chosen = ["--calibration", str(args.calibration)] if args.calibration else []
    hub = ["--data", str(settings.data), "--keys", str(settings.keys), *changed]
    for address in settings.listen:
        hub += ["--listen", address]
    if settings.key:
        hub += ["--key", str(settings.key)]
    if args.retention:
        hub += ["--retention", args.retention]
    if args.metrics:
        hub += ["--metrics", args.metrics]
    table = processes(args.source, args.workers, common, hub, chosen)
    return Supervisor(table).run()


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 256:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number from 1 to 256")
    return int(text)
