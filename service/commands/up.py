"""`denseface up`."""

import argparse
import os
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from denseface.service.commands import _options
from denseface.service.commands._options.kiosk import add_kiosk, kiosk_settings, repeated_kiosk

KIOSK_VARIABLE = "DENSEFACE_KIOSK"
"""`off` stands for `--no-kiosk`."""
_STDERR = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--source", action="append", metavar="URI",
                        help="openni2: for the first sensor, or a .oni or .npz file; several, one "
                             "for each sensor (default: openni2:)")
    parser.add_argument("--calibration", type=Path, action="append", metavar="FILE.json",
                        help="calibration that wins over the source's own; with several sources "
                             "one for each, in their order")
    _options.add_rotation(parser, action="append", default=None)
    parser.add_argument("--workers", type=_options.whole(1, 256), metavar="N",
                        default=max(1, (os.cpu_count() or 2) - 1),
                        help="reconstruction processes (default: cores less one)")
    _options.add_hub(parser)
    parser.add_argument("--no-kiosk", action="store_true",
                        help=f"do not serve the page for visitors (also: {KIOSK_VARIABLE}=off)")
    add_kiosk(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import start_process

    link = start_process("up", args.log)
    from denseface.service.daemons.supervisor import Supervisor, check_settings, process_table

    settings = _options.service_settings(args)
    check_settings(settings)
    if args.preset or args.set:
        _options.recon_settings(args)  # the hub's: what is wrong with them is said here
    table = process_table(
        args.workers,
        common=_options.repeated(args, "address", "log", "debug"),
        hub=_options.repeated(args, "data", "keys", "key", "listen", "retention", "metrics",
                              "preset", "set"),
        captures=_captures(args.source or ["openni2:"], args.calibration or [], args.rotate or []),
        kiosk=(kiosk := _kiosk(args)))
    with link, _welcome(args, settings.address, kiosk):
        silence_s = max(settings.hang_timeout_s, settings.silence_s)
        return Supervisor(table, silence_s, link.manager).run()


def _welcome(
    args: argparse.Namespace, address: str, kiosk: list[str] | None
) -> AbstractContextManager[None]:
    """Say on a terminal when presses can be made, and what to type."""
    if not os.isatty(_STDERR) or args.log == "json":
        return nullcontext()
    from denseface.service.tools.welcome import next_steps, welcoming

    page = None if kiosk is None else kiosk_settings(args)
    shown = page.url if page and page.address[1] else ""  # a free port is told by the log
    return welcoming(address, next_steps(address, shown))


def _kiosk(args: argparse.Namespace) -> list[str] | None:
    """Give the flags of the kiosk's process; None where there is to be none."""
    import structlog

    from denseface.service.errors import SettingsError
    from denseface.service.kiosk.consent_text import check_files
    from denseface.service.kiosk.installed import why_not

    given = os.environ.get(KIOSK_VARIABLE, "")
    if given not in ("", "on", "off"):
        raise SettingsError(f"{KIOSK_VARIABLE}: expected on or off, found {given!r}")
    if args.no_kiosk or given == "off":
        return None
    check_files(kiosk_settings(args))
    if reason := why_not():
        structlog.get_logger("up").info(reason)
        return None
    return repeated_kiosk(args)


def _captures(
    sources: list[str], calibrations: list[Path], rotations: list[int]
) -> list[list[str]]:
    """Give the flags of each capture process."""
    from denseface.service.errors import UsageError

    if repeated := [one for one in sources if sources.count(one) > 1]:
        raise UsageError(f"--source {repeated[0]}: given twice, expected another sensor each")
    if calibrations and len(calibrations) != len(sources):
        raise UsageError(f"--calibration: {len(calibrations)} given for {len(sources)} sources, "
                         "expected one for each")
    if len(rotations) not in (0, 1, len(sources)):
        raise UsageError(f"--rotate: {len(rotations)} given for {len(sources)} sources, expected "
                         "one for each, or one for all")
    if len(rotations) == 1:
        rotations = rotations * len(sources)
    return [[f"--source={source}", *(f"--calibration={one}" for one in calibrations[at:at + 1]),
             *(f"--rotate={one}" for one in rotations[at:at + 1])]
            for at, source in enumerate(sources)]
