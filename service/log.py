"""Logging: one line for each event, on stderr, never with image data."""

import logging
import sys
from typing import Literal

import structlog

__all__ = ["LogFormat", "configure"]

LogFormat = Literal["text", "json"]


def configure(how: LogFormat, process: str) -> None:
    """Send every event of this process to stderr, with its name."""
    renderers: list[structlog.typing.Processor]
    if how == "json":
        renderers = [structlog.processors.format_exc_info,
                     structlog.processors.JSONRenderer()]
    else:
        renderers = [structlog.dev.ConsoleRenderer(
            colors=sys.stderr.isatty(),
            exception_formatter=structlog.dev.plain_traceback)]
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            *renderers,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.WriteLoggerFactory(file=sys.stderr),
        cache_logger_on_first_use=True,
    )
    structlog.contextvars.bind_contextvars(process=process)
