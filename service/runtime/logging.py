"""Logging: one line for each event, on stderr, never with image data."""

import logging
import math
import sys
import threading
import warnings
from typing import Any, Literal, TextIO

import structlog
from structlog.typing import EventDict, Processor

__all__ = ["LogFormat", "configure"]

LogFormat = Literal["text", "json"]


def configure(log_format: LogFormat, process: str) -> None:
    """Send every event of this process to stderr, with the process's name.

    In JSON, what Python and the libraries report becomes events too: warnings, records of the
    standard library's logging, exceptions that nobody catches.
    """
    renderers: list[Processor]
    if log_format == "json":
        renderers = [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
    else:
        renderers = [structlog.dev.ConsoleRenderer(
            colors=sys.stderr.isatty(), exception_formatter=structlog.dev.plain_traceback)]

    def add_process(_: Any, __: str, event: EventDict) -> EventDict:
        event["process"] = process
        return event

    structlog.configure(
        processors=[
            add_process,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            _without_data,
            *renderers,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.WriteLoggerFactory(file=sys.stderr),
        cache_logger_on_first_use=True,
    )
    if log_format == "json":
        _forward_others()


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
            record.levelno, record.getMessage(), logger=record.name, exc_info=record.exc_info)


def _forward_others() -> None:
    log = structlog.get_logger("python")

    def warning(
        message: Warning | str, category: type[Warning], filename: str, lineno: int,
        file: TextIO | None = None, line: str | None = None,  # noqa: ARG001
    ) -> None:
        log.warning(str(message), category=category.__name__, where=f"{filename}:{lineno}")

    def uncaught(what: "threading.ExceptHookArgs | sys.UnraisableHookArgs") -> None:
        if what.exc_value is not None:
            log.critical("uncaught", exc_info=what.exc_value)

    warnings.showwarning = warning
    sys.excepthook = lambda _, error, __: log.critical("uncaught", exc_info=error)
    threading.excepthook = sys.unraisablehook = uncaught
    logging.root.handlers[:] = [_Forward()]
