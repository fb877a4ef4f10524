"""Everything that may be written of one face: cloud, report, picture."""

from pathlib import Path

from denseface.recon.face import Face
from denseface.service.errors import StoreError, UsageError, reason_of
from denseface.service.export.formats import check_ending, save_face
from denseface.service.runtime.files import write_atomically

__all__ = ["FaceFiles"]


class FaceFiles:
    """Where to write; each may be None.

    Raises
    ------
    FormatError
        Where an ending is not known.
    UsageError
        Where a folder does not exist: better said before the work than after.
    """

    def __init__(self, cloud: Path | None, report: Path | None, preview: Path | None) -> None:
        self._cloud, self._report, self._preview = cloud, report, preview
        if cloud:
            check_ending(cloud)
        for path, ending in ((report, ".json"), (preview, ".png")):
            if path and path.suffix.lower() != ending:
                raise UsageError(f"{path}: expected a name that ends in {ending}")
        for path in (cloud, report, preview):
            if path and not path.absolute().parent.is_dir():
                raise UsageError(f"{path}: no such folder: {path.parent}")

    def write(self, face: Face) -> None:
        """Write all; each file is whole or not there.

        Raises
        ------
        StoreError
            Where a file cannot be written.
        """
        try:
            if self._cloud:
                save_face(face, self._cloud)
            if self._report:
                text = face.report.model_dump_json(indent=2) + "\n"
                write_atomically(self._report, [text.encode()], durable=False)
            if self._preview:
                from denseface.service.export.render import render

                write_atomically(self._preview, [render(face)], durable=False)
        except OSError as error:
            raise StoreError(f"{error.filename or ''}: {reason_of(error)}") from error
