"""What is made of each frame: the same for all of a folder, however often a batch is begun again.

A folder whose faces were made in different ways is of no use to who counts them: what was made
with other settings, or by another version, is another folder.
"""

import hashlib
import json
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from denseface.capture.frame import DepthRounding
from denseface.capture.image_pair import PairReading
from denseface.files import read_bounded
from denseface.recon.settings import Settings
from denseface.service.errors import UsageError, reason_of
from denseface.service.export import ExportOptions, FaceFiles
from denseface.service.export.printing.choice import Printing
from denseface.service.tools.frames import FrameChoice
from denseface.version import VERSION

__all__ = ["Plan"]

_MAX_CALIBRATION_BYTES = 1 << 20


@dataclass(frozen=True)
class Plan:
    """How frames are read, faces made, and files written.

    Attributes
    ----------
    choice : how frames are read; its calibration absolute
    settings : of the reconstruction
    ending : of faces' files, with its dot
    options : of faces' files
    textured : faces' meshes have the colour image as their texture
    report, picture : whether each is written beside the face
    every : of a recording, each so many-th frame is taken
    """

    choice: FrameChoice
    settings: Settings = field(default_factory=Settings)
    ending: str = ".ply"
    options: ExportOptions = field(default_factory=ExportOptions)
    textured: bool = False
    report: bool = False
    picture: bool = False
    every: int = 1

    def files(self, base: Path) -> FaceFiles:
        """Give the files of a face by their path without an ending; raises as `FaceFiles`."""
        return FaceFiles(base.with_name(base.name + self.ending),
                         base.with_name(f"{base.name}.json") if self.report else None,
                         base.with_name(f"{base.name}.png") if self.picture else None,
                         options=self.options, textured=self.textured)

    def to_json(self) -> str:
        """Give all that decides what becomes of a frame, with the version, in a fixed order.

        Raises
        ------
        UsageError
            The calibration cannot be read.
        """
        choice, options = self.choice, self.options
        reading = choice.reading
        return json.dumps({
            "version": VERSION,
            "settings": self.settings.model_dump(mode="json"),
            "max_pixels": choice.max_pixels,
            "rotation": choice.rotation,
            "calibration": str(choice.calibration) if choice.calibration else None,
            "calibration_sha256": _digest(choice.calibration),
            "reading": reading and {"unit_mm": reading.unit_mm, "registered": reading.registered,
                                    "rounding": str(reading.rounding)},
            "format": self.ending[1:], "holes": options.holes, "compact": options.compact,
            "copyright": options.copyright, "textured": self.textured,
            "solid": options.printing.solid, "wall_mm": options.printing.wall_mm,
            "height_mm": options.printing.height_mm,
            "report": self.report, "preview": self.picture, "every": self.every,
        }, sort_keys=True)

    @classmethod
    def of_json(cls, text: str) -> "Plan":
        """Read what `to_json` gave, in a process of the same version.

        Raises
        ------
        UsageError
            This process has another version, or another calibration under that name.
        """
        return _read(text)

    @staticmethod
    def difference(there: dict[str, Any], asked: dict[str, Any]) -> str:
        """Say what differs between two plans, as JSON has them; empty where nothing does."""
        differs = []
        for name in sorted(there.keys() | asked.keys()):
            before, now = there.get(name), asked.get(name)
            if before == now:
                continue
            if name == "settings" and isinstance(before, dict) and isinstance(now, dict):
                differs += [f"{one} was {_shown(before.get(one))}, is {_shown(now.get(one))}"
                            for one in sorted(before.keys() | now.keys())
                            if before.get(one) != now.get(one)]
            elif name == "calibration_sha256":
                if there.get("calibration") == asked.get("calibration"):
                    differs.append("the calibration's contents changed")
            else:
                differs.append(f"{name} was {_shown(before)}, is {_shown(now)}")
        return "; ".join(differs)


@lru_cache(maxsize=4)
def _read(text: str) -> Plan:
    given = json.loads(text)
    if given["version"] != VERSION:
        raise UsageError(f"a worker has denseface {VERSION}, the batch is of {given['version']}")
    calibration = Path(given["calibration"]) if given["calibration"] else None
    if _digest(calibration) != given["calibration_sha256"]:
        raise UsageError(f"{calibration}: a worker finds another calibration there")
    reading = given["reading"] and PairReading(
        given["reading"]["unit_mm"], given["reading"]["registered"],
        rounding=DepthRounding(given["reading"]["rounding"]))
    return Plan(
        FrameChoice(given["max_pixels"], calibration, reading, given["rotation"]),
        Settings.model_validate(given["settings"]), f".{given['format']}",
        ExportOptions(given["holes"], None, given["compact"], given["copyright"],
                      Printing(given["solid"], given["wall_mm"], given["height_mm"])),
        given["textured"], given["report"], given["preview"], given["every"])


def _digest(path: Path | None) -> str | None:
    if path is None:
        return None
    try:
        return hashlib.sha256(read_bounded(path, _MAX_CALIBRATION_BYTES)).hexdigest()
    except OSError as error:
        raise UsageError(f"{path}: {reason_of(error)}") from error


def _shown(value: object) -> str:
    return "not given" if value is None else str(value)
