"""What other programs import: press, wait for faces, follow what is published."""

from importlib import import_module
from typing import TYPE_CHECKING

from denseface.service.client.blocking import Client
from denseface.service.client.events import (
    Published,
    PublishedFace,
    PublishedFailure,
    PublishedHint,
    PublishedPreview,
)
from denseface.service.client.operator import Operator

if TYPE_CHECKING:
    from denseface.service.client.aio import AsyncClient
    from denseface.service.client.aio_operator import AsyncOperator

__all__ = ["AsyncClient", "AsyncOperator", "Client", "Operator", "Published", "PublishedFace",
           "PublishedFailure", "PublishedHint", "PublishedPreview"]

_MODULES = {"AsyncClient": "aio", "AsyncOperator": "aio_operator"}
"""A command needs no asyncio, and waits for its import."""


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
