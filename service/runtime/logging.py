"""Logging: one line for each event, on stderr, never with image data."""

import logging
import math
import sys
import threading
import warnings
from types import TracebackType
from typing import Any, Literal, TextIO

import structlog

__all__ = ["LogFormat", "configure"]

LogFormat = Literal["text", "json"]


def configure(how: LogFormat, process: str) -> None:
    """Send every event of this process to stderr, with its name.

    As JSON, also what Python itself and the libraries have to say comes as events: warnings, the
    standard library's logging, errors that nobody catches.
    """
    renderers: list[structlog.typing.Processor]
    if how == "json":
        renderers = [structlog.processors.format_exc_info, _finite,
                     structlog.processors.JSONRenderer()]
    else:
        renderers = [_colored() if sys.stderr.isatty() else _plain]

    def name(
        _: Any, __: str, event: structlog.typing.EventDict
    ) -> structlog.typing.EventDict:
        event["process"] = process
        return event

    structlog.configure(
        processors=[
            name,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            _without_data,
            *renderers,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.WriteLoggerFactory(file=sys.stderr),
        cache_logger_on_first_use=True,
    )
    if how == "json":
        _catch_the_rest()


def _colored(*, colors: bool = True) -> structlog.dev.ConsoleRenderer:
    return structlog.dev.ConsoleRenderer(
        colors=colors, exception_formatter=structlog.dev.plain_traceback)


_console = _colored(colors=False)
_QUOTED = frozenset(" \t=\r\n\"'")


def _plain(logger: Any, name: str, event: structlog.typing.EventDict) -> str:
    """Write a line as `_console` does, in a quarter of its time: of a capture there are seven."""
    if not event.keys().isdisjoint(("exc_info", "exception", "stack")):
        return _console(logger, name, event)
    stamp, level, what = event.pop("timestamp"), event.pop("level"), event.pop("event")
    shown = [f"{key}={_quoted(value)}" for key, value in sorted(event.items())]
    return " ".join((stamp, f"[{level:<9}]", f"{what!s:<30}", *shown)).rstrip(" ")


def _quoted(value: Any) -> str:
    return value if isinstance(value, str) and _QUOTED.isdisjoint(value) else repr(value)


def _without_data(
    _: Any, __: str, event: structlog.typing.EventDict
) -> structlog.typing.EventDict:
    """Put sizes in the place of arrays and bytes: a log may go where faces may not."""
    return {key: value if key == "exc_info" else _size(value) for key, value in event.items()}


def _size(value: Any) -> Any:
    shape = getattr(value, "shape", None)
    if shape:
        return f"<{getattr(value, 'dtype', type(value).__name__)} {list(shape)}>"
    if isinstance(value, bytes | bytearray | memoryview):
        return f"<{len(value)} bytes>"
    if isinstance(value, list | tuple | set | frozenset):
        return [_size(one) for one in value]
    if isinstance(value, dict):
        return {str(key): _size(one) for key, one in value.items()}
    return value


def _finite(
    _: Any, __: str, event: structlog.typing.EventDict
) -> structlog.typing.EventDict:
    """JSON has no word for what is not finite."""
    return {key: str(value) if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in event.items()}


class _Forward(logging.Handler):
    """Hands on what a library logs."""

    def emit(self, record: logging.LogRecord) -> None:
        structlog.get_logger(record.name).log(
            record.levelno, record.getMessage(), logger=record.name, exc_info=record.exc_info)


def _catch_the_rest() -> None:
    log = structlog.get_logger("python")

    def warning(
        message: Warning | str, category: type[Warning], filename: str, lineno: int,
        file: TextIO | None = None, line: str | None = None,  # noqa: ARG001
    ) -> None:
        log.warning(str(message), category=category.__name__, where=f"{filename}:{lineno}")

    def uncaught(
        kind: type[BaseException], error: BaseException, traceback: TracebackType | None
    ) -> None:
        log.critical("uncaught", exc_info=(kind, error, traceback))

    def in_thread(what: threading.ExceptHookArgs) -> None:
        if what.exc_value is not None:
            uncaught(what.exc_type, what.exc_value, what.exc_traceback)

    def unraisable(what: "sys.UnraisableHookArgs") -> None:
        if what.exc_value is not None:
            uncaught(what.exc_type, what.exc_value, what.exc_traceback)

    warnings.showwarning = warning
    sys.excepthook = uncaught
    threading.excepthook = in_thread
    sys.unraisablehook = unraisable
    logging.root.handlers[:] = [_Forward()]
