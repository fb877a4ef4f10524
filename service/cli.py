"""The command `denseface`: an error is one line on stderr and an exit status.

0 done; 1 the job failed; 2 wrong usage, unreadable input or no driver to read it with; 130 after
Ctrl-C; 141 where the reader of stdout left. The status is the same where stderr cannot be written.
"""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from typing import NoReturn

from denseface.service.commands import COMMANDS, load
from denseface.service.runtime.process import forbid_core_dumps, untried_python
from denseface.service.runtime.signals import PARENT_VARIABLE
from denseface.service.runtime.terminal import (
    complain,
    complain_of,
    discard_unless_flushed,
    fill_standard_descriptors,
    reader_left,
    say,
)

__all__ = ["main"]

_FAILED, _USAGE, _CTRL_C, _BROKEN_PIPE, _TERMINATED = 1, 2, 130, 141, 143
"""Exit statuses; above 128, 128 and the number of the signal, as a shell has it."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        complain(f"{self.prog}: {message} (see {self.prog} --help)")
        self.exit(_USAGE)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and give its exit status."""
    fill_standard_descriptors()
    forbid_core_dumps()
    args = _parser().parse_args(arguments)
    # Once: not by each process that `denseface up` starts.
    if (doubt := untried_python()) and PARENT_VARIABLE not in os.environ:
        complain(f"denseface: {doubt}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(_TERMINATED))
    try:
        status: int = load(args.command).run(args)
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        return _CTRL_C
    except Exception as error:
        if isinstance(error, BrokenPipeError) and reader_left(sys.stdout):
            return _BROKEN_PIPE
        if args.debug:
            if sys.excepthook is sys.__excepthook__:
                sys.excepthook = complain_of
            raise
        line = " ".join(str(error).split()) or type(error).__name__
        if getattr(args, "log", "text") == "json":
            import structlog

            structlog.get_logger(args.command).critical("ended", reason=line)
        else:
            complain(f"denseface {args.command}: {line}")
        return _exit_status(error)
    finally:
        # An exception while libraries unload, which takes OpenNI2 a while, would be a traceback.
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        discard_unless_flushed(sys.stdout)
    return status


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="denseface", description="One press, one depth frame, one dense coloured 3D face.",
        allow_abbrev=False)
    parser.add_argument("--version", action=_Version)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, text in COMMANDS.items():
        command = commands.add_parser(
            name, help=text, description=text[0].upper() + text[1:] + ".", allow_abbrev=False)
        command.add_argument(
            "--debug", action="store_true", help="show a traceback where something goes wrong")
        load(name).add_arguments(command)
    return parser


class _Version(argparse.Action):
    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help="show the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        say(version("denseface"))
        parser.exit()


def _exit_status(error: Exception) -> int:
    from denseface.capture.errors import (
        CalibrationError,
        DriverError,
        FrameError,
        UnreadableSourceError,
    )
    from denseface.service import errors

    wrong_input = (CalibrationError, DriverError, FrameError, UnreadableSourceError,
                   errors.FormatError, errors.FrameTooLargeError, errors.LocalProtocolError,
                   errors.SettingsError, errors.UsageError)
    return _USAGE if isinstance(error, wrong_input) else _FAILED
