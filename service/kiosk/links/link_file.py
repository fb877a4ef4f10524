"""Where links survive a restart: one small file for this user alone."""

from pathlib import Path

from pydantic import ValidationError

from denseface.files import read_bounded
from denseface.service.errors import CorruptFileError, StoreError, first_error, reason_of
from denseface.service.kiosk.links.link_store import LinkRecords
from denseface.service.runtime.files import write_atomically

__all__ = ["LinkFile"]

_MAX_BYTES = 2**20
"""Of the file: more than all links that are kept."""
_MODE = 0o600


class LinkFile:
    """Reads and writes the records of links."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> LinkRecords:
        """Give what is kept; nothing where there is no file.

        Raises
        ------
        StoreError
            It cannot be read.
        CorruptFileError
            It is not as `write` leaves it.
        """
        try:
            data = read_bounded(self.path, _MAX_BYTES)
        except FileNotFoundError:
            return LinkRecords()
        except OSError as error:
            raise StoreError(f"{self.path}: {reason_of(error)}") from error
        try:
            return LinkRecords.model_validate_json(data)
        except ValidationError as error:
            field, why = first_error(error)
            raise CorruptFileError(f"{self.path}: no file of links: {field}: {why}") from error

    def write(self, records: LinkRecords) -> None:
        """Keep records, all or none; StoreError where the disk refuses."""
        try:
            write_atomically(self.path, [records.model_dump_json().encode()], mode=_MODE)
        except OSError as error:
            raise StoreError(f"{self.path}: {reason_of(error)}") from error
