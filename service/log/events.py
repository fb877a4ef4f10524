"""Logging: one line for each event, on stderr, never with image data, never in the way."""

import io
import logging
import math
import os
import sys
import threading
import warnings
from collections.abc import Callable
from typing import Any, Literal, TextIO

from denseface.service.log._structlog import EventDict, ExcInfo, Processor, structlog
from denseface.service.log.ids import IdHider
from denseface.service.log.limit import LogLimit
from denseface.service.log.output import LogStream, process_log
from denseface.service.runtime.terminal import printable

__all__ = ["LogFormat", "configure"]

LogFormat = Literal["text", "json"]


def configure(log_format: LogFormat, process: str, *, ids: bool = True) -> None:
    """Send every event of this process to stderr, with the process's name.

    So goes what is printed on `sys.stderr`. Nothing of it waits or raises: what cannot be written
    is lost and counted (`service.log.output`), what is too much of one kind is suppressed and
    counted (`service.log.limit`). In text, what came from outside is escaped. In JSON, what Python
    and the libraries report becomes events too: warnings, records of the standard library's
    logging, exceptions that nobody catches. Without `ids`, hashes stand for captures' ids.
    """
    hider = None if ids else IdHider()
    hide: Callable[[str], str] = hider.hide if hider else str
    limit = LogLimit()
    renderers: list[Processor] = [hider] if hider else []
    if log_format == "json":
        renderers = [structlog.processors.format_exc_info, *renderers,
                     structlog.processors.JSONRenderer()]
    else:
        renderers += [_escape, structlog.dev.ConsoleRenderer(
            colors=os.isatty(2), exception_formatter=_traceback_writer(hide))]

    def add_process(_: Any, __: str, event: EventDict) -> EventDict:
        event["process"] = process
        return event

    structlog.configure(
        processors=[
            limit,
            add_process,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            _without_data,
            *renderers,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=_Lines,
        cache_logger_on_first_use=True,
    )
    process_log.on_recovery = _log_lost
    process_log.on_interval = lambda: _log_suppressed(limit)
    if log_format == "json":
        sys.stderr = LogStream(
            lambda line: structlog.get_logger("stderr").warning(line, per=("stderr",)))
        _forward_others()
    else:
        sys.stderr = LogStream(lambda line: process_log.put(printable(hide(line))))


class _Lines:
    """What structlog writes rendered events to."""

    def __init__(self, *_: object) -> None:
        pass

    def msg(self, line: str) -> None:
        process_log.put(line)

    debug = info = warning = error = critical = exception = log = msg


def _log_lost(lines: int, since_start: int) -> None:
    structlog.get_logger("log").warning("lines lost", lines=lines, since_start=since_start)


def _log_suppressed(limit: LogLimit) -> None:
    for kind, lines in limit.suppressed():
        structlog.get_logger("log").info("lines suppressed", of=kind, lines=lines)


class _Escaped(str):
    """A text that is escaped already; what quotes it does not escape it once more."""

    def __repr__(self) -> str:
        return f"'{self}'"


def _escape(_: Any, __: str, event: EventDict) -> EventDict:
    return {key: _Escaped(printable(value))
            if isinstance(value, str) and not value.isprintable() else value
            for key, value in event.items()}


def _traceback_writer(hide: Callable[[str], str]) -> Callable[[TextIO, ExcInfo], None]:
    def write(stream: TextIO, error: ExcInfo) -> None:
        """Write it indented, so that no line of an error's text passes for one of the log."""
        text = io.StringIO()
        structlog.dev.plain_traceback(text, error)
        for line in hide(text.getvalue()).strip("\n").split("\n"):
            stream.write(f"\n  {printable(line)}")

    return write


def _without_data(_: Any, __: str, event: EventDict) -> EventDict:
    """Replace arrays and bytes by their sizes: who may read a log may not see faces."""
    return {key: value if key == "exc_info" else _loggable(value) for key, value in event.items()}


def _loggable(value: Any) -> Any:
    shape = getattr(value, "shape", None)
    if shape:
        return f"<{getattr(value, 'dtype', type(value).__name__)} {list(shape)}>"
    if isinstance(value, bytes | bytearray | memoryview):
        return f"<{len(value)} bytes>"
    if isinstance(value, list | tuple | set | frozenset):
        return [_loggable(one) for one in value]
    if isinstance(value, dict):
        return {str(key): _loggable(one) for key, one in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # JSON has no such numbers
    return value


class _Forward(logging.Handler):
    """Makes events of the records that libraries log."""

    def emit(self, record: logging.LogRecord) -> None:
        structlog.get_logger(record.name).log(
            record.levelno, record.getMessage(), logger=record.name, exc_info=record.exc_info,
            per=("logging", record.name))


def _forward_others() -> None:
    log = structlog.get_logger("python")

    def warning(
        message: Warning | str, category: type[Warning], filename: str, lineno: int,
        file: TextIO | None = None, line: str | None = None,  # noqa: ARG001
    ) -> None:
        log.warning(str(message), category=category.__name__, where=f"{filename}:{lineno}",
                    per=("warnings",))

    def uncaught(what: "threading.ExceptHookArgs | sys.UnraisableHookArgs") -> None:
        if what.exc_value is not None:
            log.critical("uncaught", exc_info=what.exc_value)

    warnings.showwarning = warning
    sys.excepthook = lambda _, error, __: log.critical("uncaught", exc_info=error)
    threading.excepthook = sys.unraisablehook = uncaught
    logging.root.handlers[:] = [_Forward()]
