"""What the parts of the hub share."""

from typing import NamedTuple

from denseface.service.hub.captures import Captures
from denseface.service.hub.peers import Peers
from denseface.service.settings import ServiceSettings
from denseface.service.storage import FolderStore, Writer

LOCAL = "local"
"""Stands in the log for the key of a peer that needed none."""


class Common(NamedTuple):
    """What the parts of the hub share."""

    store: FolderStore
    captures: Captures
    writer: Writer
    peers: Peers
    settings: ServiceSettings
