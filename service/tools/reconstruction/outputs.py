"""Where faces, their reports and their pictures go: files by name, or folders."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from denseface.service.errors import UsageError
from denseface.service.export import FORMATS, ExportOptions, FaceFiles, check_outputs
from denseface.service.export.formats import beside

__all__ = ["Outputs"]

_REPORT, _PICTURE, _FRAME = ".json", ".png", ".npz"


@dataclass
class Outputs:
    """What the flags `-o`, `--report` and `--preview` say.

    A value that ends in `/`, or is a folder that is there, stands for a folder. Where there are
    several faces, each must be one.

    Attributes
    ----------
    face, report, picture : file or folder, as given; None where not asked for
    ending : of faces' files in a folder, with its dot; None for `.ply`
    table : file of the table, `.csv`; None where not asked for
    options : of faces' files
    textured : faces' meshes have the colour image as their texture
    """

    face: str | None = None
    report: str | None = None
    picture: str | None = None
    ending: str | None = None
    table: Path | None = None
    options: ExportOptions = field(default_factory=ExportOptions)
    textured: bool = False
    _taken: set[str] = field(default_factory=set, init=False)
    _read: set[Path] = field(default_factory=set, init=False)

    @property
    def any(self) -> bool:
        """Whether anything is to be written."""
        return bool(self.table) or any(given is not None for given in self._given.values())

    def check(self, names: Sequence[str], read: Iterable[Path], *, several: bool) -> None:
        """Check the flags, before there is a face.

        Parameters
        ----------
        names : of faces, one or more
        read : files and folders that faces are made of, which nothing may replace

        Raises
        ------
        UsageError
            They name one file for several faces, or what is read.
        FormatError, UsageError, StoreError
            As `FaceFiles`: a file cannot be written, or its ending is wrong.
        """
        if self.ending and not (self.face and (several or _is_folder(self.face))):
            raise UsageError(f"--format {self.ending[1:]}: expected with a folder, -o DIR/; a "
                             "file's own ending picks its format")
        for flag, given in self._given.items():
            if several and given is not None and not _is_folder(given):
                known = Path(given).suffix.lower() in (*FORMATS, _REPORT, _PICTURE)
                if not given or known or Path(given).exists():
                    raise UsageError(f"{flag} {given}: expected a folder, as there are several "
                                     f"faces: {flag} DIR/")
        if several:
            self.face, self.report, self.picture = (
                f"{one}/" if one and not _is_folder(one) else one
                for one in (self.face, self.report, self.picture))
        self._read = {path.resolve() for path in read}
        for name in names:
            self._placed(name)
        self.files(names[0])
        check_outputs((self.table, ".csv"))

    def unique(self, name: str) -> str:
        """Give a name that no face before had, by which its files are called in folders."""
        number, free = 2, name
        while free.casefold() in self._taken:
            number, free = number + 1, f"{name}-{number}"
        self._taken.add(free.casefold())
        return free

    def files(self, name: str) -> FaceFiles:
        """Give the files of a face of a name; raises as `FaceFiles`, and where one is read."""
        return FaceFiles(*self._placed(name), options=self.options, textured=self.textured)

    def _placed(self, name: str) -> tuple[Path | None, Path | None, Path | None]:
        """Give where face, report and picture go."""
        endings = self.ending or next(iter(FORMATS)), _REPORT, _PICTURE
        face, report, picture = (
            Path(given, name + ending) if given and _is_folder(given) else
            None if given is None else Path(given)
            for given, ending in zip(self._given.values(), endings, strict=True))
        further = beside(face, textured=self.textured) if face else ()
        for path in filter(None, (face, report, picture, *further)):
            if path.resolve() in self._read:
                raise UsageError(f"{path}: is read, and would be replaced by what is written: name "
                                 "another place")
        if face and face.suffix.lower() == _FRAME and face.resolve().parent in self._read:
            raise UsageError(f"{face}: would be among the frames that are read from its folder: "
                             "name another folder")
        return face, report, picture

    @property
    def _given(self) -> dict[str, str | None]:
        return {"-o": self.face, "--report": self.report, "--preview": self.picture}


def _is_folder(given: str) -> bool:
    return bool(given) and (given.endswith(os.sep) or Path(given).is_dir())
