"""All that may be written of one face: cloud or mesh, report, rendering."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.files import check_place, write_whole
from denseface.service.errors import StoreError, UsageError, reason_of
from denseface.service.export.formats import beside, check_options, save_face
from denseface.service.export.options import PLAIN, ExportOptions
from denseface.service.export.printing import check_printable

if TYPE_CHECKING:
    from denseface.capture.frame import RgbdFrame
    from denseface.recon.face import Face

__all__ = ["FaceFiles", "check_outputs", "save_report"]

_LEAST_BYTES = 2**16
"""For which there must be room: smaller than any face's file."""


def check_outputs(*outputs: tuple[Path | None, str | None]) -> None:
    """Check that files can be written, before there is anything to write.

    Parameters
    ----------
    outputs : each a path, or None where it is not asked for, and the ending that it must have, or
        None for any; its folder may be missing, but there must be a place for it

    Raises
    ------
    UsageError
        An ending is wrong, or the place is in a hub's data folder.
    StoreError
        There may nothing be written, or there is no room.
    """
    from denseface.service.runtime.files import check_outside_hub

    for path, ending in outputs:
        if path and ending and path.suffix.lower() != ending:
            raise UsageError(f"{path}: expected a name that ends in {ending}")
    for path, _ in outputs:
        if path:
            check_outside_hub(path)
            with _naming(path):
                check_place(path, _LEAST_BYTES)


def save_report(face: "Face", path: Path, *, mode: int | None = None) -> None:
    """Write a face's report as JSON, as `save_face` writes the face; OSError likewise."""
    text = face.report.model_dump_json(indent=2) + "\n"
    write_whole(path, [text.encode()], mode=mode)


@dataclass(frozen=True)
class FaceFiles:
    """Where to write a face; None is not written, and it is false where nothing is.

    Checked here, before the face is made.

    Raises
    ------
    FormatError
        Where an ending is not known.
    UsageError
        The format cannot have what is asked for.
    UsageError, StoreError
        As `check_outputs`.
    """

    output: Path | None = None
    """Cloud or mesh, in one of `FORMATS`."""
    report: Path | None = None
    """`.json`"""
    rendering: Path | None = None
    """`.png`"""
    mode: int | None = None
    """Of each file; None for 666 less the umask."""
    options: ExportOptions = PLAIN
    """Of cloud or mesh."""
    textured: bool = False
    """The mesh has a texture: the colour image of its frame."""

    def __post_init__(self) -> None:
        asked = self.options.asked | ({"texture"} if self.textured else set())
        if self.output:
            check_options(self.output, asked)
            check_printable(self.output.suffix.lower(), self.options.printing)
        elif asked:
            raise UsageError(f"{' and '.join(sorted(asked))}: expected with a file of the face, "
                             "and none is asked for")
        check_outputs((self.output, None), (self.report, ".json"), (self.rendering, ".png"),
                      *((path, None) for path in self.beside))

    def __bool__(self) -> bool:
        return bool(self.output or self.report or self.rendering)

    @property
    def beside(self) -> tuple[Path, ...]:
        """Give the files that the cloud's or mesh's own file names."""
        return beside(self.output, textured=self.textured) if self.output else ()

    def write(self, face: "Face", frame: "RgbdFrame | None" = None) -> None:
        """Write all; each file is whole or not there.

        Parameters
        ----------
        frame : that the face was made of: the texture, where it is `textured`; the points' own
            colours are, where there is none or it has no colour image

        Raises
        ------
        StoreError
            Where a file cannot be written.
        UsageError
            There is no texture to be had of this frame.
        """
        if self.output:
            options = self.options
            if self.textured:
                whole = frame is not None and frame.color is not None
                options = replace(options, texture=frame if whole else "points")
            with _naming(self.output):
                save_face(face, self.output, mode=self.mode, options=options)
        if self.report:
            with _naming(self.report):
                save_report(face, self.report, mode=self.mode)
        if self.rendering:
            from denseface.service.export.render import render

            with _naming(self.rendering):
                write_whole(self.rendering, [render(face)], mode=self.mode)


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Raise what the system says as a StoreError that names the file asked for."""
    try:
        yield
    except OSError as error:
        raise StoreError(f"{path}: {reason_of(error)}") from error
