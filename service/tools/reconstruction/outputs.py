"""Where faces, their reports and their pictures go: files by name, or folders."""

import os
from dataclasses import dataclass, field
from pathlib import Path

from denseface.service.errors import UsageError
from denseface.service.export import FORMATS, FaceFiles, check_outputs

__all__ = ["Outputs"]

_REPORT, _PICTURE = ".json", ".png"


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
    """

    face: str | None = None
    report: str | None = None
    picture: str | None = None
    ending: str | None = None
    table: Path | None = None
    _taken: set[str] = field(default_factory=set, init=False)

    @property
    def any(self) -> bool:
        """Whether anything is to be written."""
        return bool(self.table) or any(given is not None for given in self._given.values())

    def check(self, name: str, *, several: bool) -> None:
        """Check the flags, before there is a face of a name, or several.

        Raises
        ------
        UsageError
            They name one file for several faces.
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
        self.files(name)
        check_outputs((self.table, ".csv"))

    def unique(self, name: str) -> str:
        """Give a name that no face before had, by which its files are called in folders."""
        number, free = 2, name
        while free.casefold() in self._taken:
            number, free = number + 1, f"{name}-{number}"
        self._taken.add(free.casefold())
        return free

    def files(self, name: str) -> FaceFiles:
        """Give the files of a face of a name; raises as `FaceFiles`."""
        return FaceFiles(_placed(self.face, name, self.ending or next(iter(FORMATS))),
                         _placed(self.report, name, _REPORT), _placed(self.picture, name, _PICTURE))

    @property
    def _given(self) -> dict[str, str | None]:
        return {"-o": self.face, "--report": self.report, "--preview": self.picture}


def _is_folder(given: str) -> bool:
    return bool(given) and (given.endswith(os.sep) or Path(given).is_dir())


def _placed(given: str | None, name: str, ending: str) -> Path | None:
    if given is None:
        return None
    return Path(given, name + ending) if _is_folder(given) else Path(given)
