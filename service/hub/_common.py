"""What the parts of the hub share."""

from typing import NamedTuple

from denseface.service.hub.captures import Captures
from denseface.service.hub.peers import Peers
from denseface.service.settings import ServiceSettings
from denseface.service.storage import FolderStore, Writer


class Common(NamedTuple):
    """What the parts of the hub share."""

    store: FolderStore
    captures: Captures
    writer: Writer
    peers: Peers
    settings: ServiceSettings
