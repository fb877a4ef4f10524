"""One command: its exit status, and one line on stderr for what went wrong.

0 done; 1 the job failed; 2 wrong usage, unreadable input, or a part of the installation missing:
another try would end the same; 129, 130 and 143 after SIGHUP, Ctrl-C and SIGTERM; 141 where the
reader of stdout left. The same where stderr cannot be written.
"""

import errno
import os
import re
import sys
from collections.abc import Sequence

from denseface.errors import MissingPackageError
from denseface.missing import missing
from denseface.service.cli._parser import USAGE, parse
from denseface.service.commands import load
from denseface.service.log.kernels import KernelLines, tell_of_kernels
from denseface.service.runtime.collection import collect_from_now_on, collection_put_off
from denseface.service.runtime.interruption import Interruption, interrupted
from denseface.service.runtime.process import forbid_core_dumps, untried_python
from denseface.service.runtime.signals import PARENT_VARIABLE
from denseface.service.runtime.terminal import (
    complain,
    complain_of,
    discard_unless_flushed,
    fill_standard_descriptors,
    flush_stdout,
    reader_left,
)

_FAILED, _CTRL_C, _BROKEN_PIPE = 1, 130, 141
"""Exit statuses; above 128, 128 and the number of the signal, as a shell has it."""
_BRIEF = {"reconstruct", "press", "export", "get", "info", "list", "status", "worker"}
"""Commands that end soon, or say themselves when they have started."""
_EXTRAS = {"capture": "capture", "hub": "hub", "kiosk": "kiosk", "worker": "worker",
           "warm": "worker", "up": "all", "calibrate": "capture", "doctor": "capture",
           "live": "capture", "record": "capture", "batch": "batch"}
"""Command -> the extra with all that it needs; of the others, that of the module."""
_LONGEST = 400
"""Characters of a word that are shown: a path of a system's longest is no line."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and give its exit status."""
    with collection_put_off():
        return _main(arguments)


def _main(arguments: Sequence[str] | None) -> int:
    fill_standard_descriptors()
    forbid_core_dumps()
    # Nothing here has plugins, and pydantic would read the metadata of all that is installed.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    tell_of_kernels(KernelLines())
    try:
        args = parse(arguments)
    except OSError as error:  # there is no place for the help
        discard_unless_flushed(sys.stdout)
        if isinstance(error, BrokenPipeError):
            return _BROKEN_PIPE
        complain(f"denseface: {_line(error)}")
        return _FAILED
    # Once: not by each process that `denseface up` starts.
    if (doubt := untried_python()) and PARENT_VARIABLE not in os.environ:
        complain(f"denseface: {doubt}")
    try:
        with Interruption():
            if args.command not in _BRIEF:
                collect_from_now_on()
            status: int = load(args.command).run(args)
            flush_stdout()
    except KeyboardInterrupt:
        return _CTRL_C
    except Exception as error:
        if status := interrupted():  # whatever became of the signal on its way
            return status
        if isinstance(error, BrokenPipeError) and reader_left(sys.stdout):
            return _BROKEN_PIPE
        if args.debug:
            if sys.excepthook is sys.__excepthook__:
                sys.excepthook = complain_of
            raise
        line = _line(error, args.command)
        if getattr(args, "log", "text") == "json":
            import structlog

            structlog.get_logger(args.command).critical("ended", reason=line)
        else:
            complain(f"denseface {args.command}: {line}")
        return _exit_status(error)
    finally:
        discard_unless_flushed(sys.stdout)
    return status


def _line(error: Exception, command: str = "") -> str:
    from denseface.service.errors import reason_of

    if isinstance(error, ImportError) and (told := missing(error, _EXTRAS.get(command, ""))):
        error = told
    said = str(error)
    if isinstance(error, OSError) and error.strerror and said.startswith("[Errno "):
        names = [str(one) for one in (error.filename, error.filename2) if one is not None]
        said = ": ".join([*names, reason_of(error)])
    said = " ".join(said.split()) or type(error).__name__
    if isinstance(error, ImportError) and not isinstance(error, MissingPackageError):
        said += f"; the installation in {sys.prefix} is incomplete: install denseface again"
    return re.sub(rf"\S{{{_LONGEST}}}\S+", lambda long: f"{long[0][:_LONGEST]}...", said)


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
                   errors.SettingsError, errors.UsageError, ImportError)
    named_wrongly = any(getattr(one, "errno", None) in (errno.ENAMETOOLONG, errno.ENOTDIR)
                        for one in (error, error.__cause__))
    return USAGE if named_wrongly or isinstance(error, wrong_input) else _FAILED
