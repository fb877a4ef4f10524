"""What other programs import: press, wait for faces, follow what is published."""

from denseface.service.client.aio import AsyncClient
from denseface.service.client.blocking import Client
from denseface.service.client.events import (
    Published,
    PublishedFace,
    PublishedFailure,
    PublishedHint,
    PublishedPreview,
)
from denseface.service.client.operator import AsyncOperator, Operator

__all__ = ["AsyncClient", "AsyncOperator", "Client", "Operator", "Published", "PublishedFace",
           "PublishedFailure", "PublishedHint", "PublishedPreview"]
