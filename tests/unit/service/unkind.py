"""A store to which things happen."""

from service.errors import DiskFullError
from service.store import FolderStore


class KilledError(BaseException):
    """The hub ends here."""


class UnkindStore(FolderStore):
    """Has no room where it is told so."""

    full = False

    def _room(self):
        if self.full:
            raise DiskFullError("no room on the disk")

    def accept(self, *arguments):
        self._room()
        super().accept(*arguments)

    def start_attempt(self, capture_id):
        self._room()
        return super().start_attempt(capture_id)

    def finish(self, result):
        self._room()
        super().finish(result)

    def fail(self, *arguments, **more):
        self._room()
        super().fail(*arguments, **more)
