"""All that may be written of one face: cloud or mesh, report, rendering."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.errors import StoreError, UsageError, reason_of
from denseface.service.export.formats import check_ending, save_face

if TYPE_CHECKING:
    from denseface.recon.face import Face

__all__ = ["FaceFiles", "check_outputs"]


def check_outputs(*outputs: tuple[Path | None, str | None]) -> None:
    """Check where files are to go, before there is anything to write.

    Parameters
    ----------
    outputs : each a path, or None where it is not asked for, and the ending that it must have, or
        None for any

    Raises
    ------
    UsageError
        An ending is wrong or a folder does not exist.
    """
    for path, ending in outputs:
        if path and ending and path.suffix.lower() != ending:
            raise UsageError(f"{path}: expected a name that ends in {ending}")
    for path, _ in outputs:
        if path and not path.absolute().parent.is_dir():
            raise UsageError(f"{path}: no such folder: {path.parent}")


@dataclass(frozen=True)
class FaceFiles:
    """Where to write a face; None is not written, and it is false where nothing is.

    Checked here, before the face is made.

    Raises
    ------
    FormatError
        Where an ending is not known.
    UsageError
        Where an ending is wrong or a folder does not exist.
    """

    output: Path | None = None
    """Cloud or mesh, in one of `FORMATS`."""
    report: Path | None = None
    """`.json`"""
    rendering: Path | None = None
    """`.png`"""
    mode: int | None = None
    """Of each file; None for 666 less the umask."""

    def __post_init__(self) -> None:
        if self.output:
            check_ending(self.output)
        check_outputs((self.output, None), (self.report, ".json"), (self.rendering, ".png"))

    def __bool__(self) -> bool:
        return bool(self.output or self.report or self.rendering)

    def write(self, face: "Face") -> None:
        """Write all; each file is whole or not there.

        Raises
        ------
        StoreError
            Where a file cannot be written.
        """
        from denseface.service.runtime.files import write_atomically

        if self.output:
            with _naming(self.output):
                save_face(face, self.output, mode=self.mode)
        if self.report:
            text = face.report.model_dump_json(indent=2) + "\n"
            with _naming(self.report):
                write_atomically(self.report, [text.encode()], sync_name=False, mode=self.mode)
        if self.rendering:
            from denseface.service.export.render import render

            with _naming(self.rendering):
                write_atomically(self.rendering, [render(face)], sync_name=False, mode=self.mode)


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Raise what the system says as a StoreError that names the file asked for."""
    try:
        yield
    except OSError as error:
        raise StoreError(f"{path}: {reason_of(error)}") from error
