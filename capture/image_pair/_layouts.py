"""Folders of image pairs, as data sets and recorders write them.

=============== ==================================================================================
layout          what is in the folder
=============== ==================================================================================
TUM RGB-D       ``depth/``, ``rgb/`` and ``associations.txt``, or ``depth.txt`` and ``rgb.txt``
ScanNet         ``depth/``, ``color/`` and ``intrinsic/intrinsic_depth.txt``, as SensReader exports,
                or ``intrinsics_depth.txt``, as `scannet_frames_25k` has it
two folders     ``depth/`` and one of ``color/``, ``rgb/``, ``image/``, ``images/``; Open3D's
                recorders add ``intrinsic.json`` or ``camera_intrinsic.json``
one folder      ``NAME.depth.png`` and ``NAME.color.png``, or names that differ in these words alone
=============== ==================================================================================
"""

import os
import re
from bisect import bisect_left
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from denseface.capture.calibration import Calibration, CameraModel, ChosenCalibration
from denseface.capture.calibration_files import read_calibration
from denseface.capture.errors import UnreadableSourceError
from denseface.capture.frame import DepthRounding
from denseface.capture.image_pair._pair import ImagePair, PairReading
from denseface.capture.image_pair._scannet import scannet_calibration
from denseface.files import read_bounded

__all__ = ["Layout", "recognised"]

_DEPTH_ENDINGS = (".png", ".tif", ".tiff", ".exr", ".npy")
_COLOR_ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".npy", ".tif", ".tiff")
_COLOR_FOLDERS = ("color", "colour", "rgb", "image", "images")
_ASSOCIATIONS = ("associations.txt", "associate.txt", "association.txt")
_INTRINSICS = ("intrinsic.json", "camera_intrinsic.json")
_MOST_FILES = 200_000
"""Of a folder: an hour and more at 30 a second."""
_MAX_LIST_BYTES = 32 * 2**20
"""Of a list of files; of as many as there may be."""
_TUM_UNIT_MM = 0.2
"""A factor of 5000 to the metre."""
_TUM_NEAR_S = 0.02
"""Within which depth and colour belong together (`associate.py` of the data set's tools)."""
_TUM_FOCAL = (525.0, 525.0, 319.5, 239.5)
_TUM_FR3 = (535.4, 539.2, 320.1, 247.6)
"""fx, fy, cx, cy that the data set recommends: ROS's default, since the depth was registered with
it, and of the sequences `freiburg3`, which are undistorted, their own."""
_TUM_SIZE = (640, 480)
_PERIOD_US = 33_333
"""Between frames that bear no times."""
_EPOCH_S = (1e9, 4e9)
"""Between which a time stamp is one since 1970."""


class Layout(NamedTuple):
    """What a folder was recognised as."""

    name: str
    pairs: tuple[ImagePair, ...]
    """In their order of time."""
    reading: PairReading


def recognised(folder: Path) -> Layout:
    """Find the pairs of a folder and what is known of them.

    Raises
    ------
    UnreadableSourceError
        No layout fits, or more than one; no pair; a list that names what is not there.
    CalibrationError
        A file of intrinsics cannot be read.
    """
    names = _listed(folder)
    colors = [name for name in _COLOR_FOLDERS if name in names and (folder / name).is_dir()]
    if "depth" not in names or not (folder / "depth").is_dir() or not colors:
        return _one_folder(folder, names)
    if len(colors) > 1:
        raise UnreadableSourceError(f"{folder}: {' and '.join(colors)} may both be the colour "
                                    "images, expected one of them")
    color = colors[0]
    if "intrinsic" in names or "intrinsics_depth.txt" in names:
        calibration = (scannet_calibration(folder / "intrinsic") if "intrinsic" in names else
                       scannet_calibration(folder, "intrinsics"))
        return Layout("ScanNet", _by_name(folder / "depth", folder / color), PairReading(
            1.0, registered=False,
            chosen=ChosenCalibration(calibration, "beside: ScanNet's matrices")))
    lists = [name for name in _ASSOCIATIONS if name in names]
    if lists or {"depth.txt", f"{color}.txt"} <= names:
        pairs = (_associated(folder, lists[0]) if lists else
                 _nearest(folder, "depth.txt", f"{color}.txt"))
        return Layout("TUM RGB-D", pairs, PairReading(
            _TUM_UNIT_MM, registered=True, chosen=_tum_calibration(folder),
            rounding=DepthRounding.CUT))
    intrinsics = next((name for name in _INTRINSICS if name in names), None)
    chosen = None
    if intrinsics:
        # Open3D's recorders align the depth with the colour: one camera is what they need.
        chosen = read_calibration(folder / intrinsics)._replace(
            origin=f"beside: {intrinsics}", notes=())
    return Layout("two folders", _by_name(folder / "depth", folder / color),
                  PairReading(registered=True if chosen else None, chosen=chosen))


def _one_folder(folder: Path, names: set[str]) -> Layout:
    by_stem = {Path(name).stem.lower(): name for name in names
               if Path(name).suffix.lower() in _COLOR_ENDINGS}
    pairs = []
    for name in sorted(names, key=_natural):
        path = Path(name)
        if path.suffix.lower() not in _DEPTH_ENDINGS or "depth" not in path.stem.lower():
            continue
        found = {by_stem[other] for word in _COLOR_FOLDERS
                 if (other := path.stem.lower().replace("depth", word)) in by_stem}
        if len(found) > 1:
            raise UnreadableSourceError(f"{folder}: {' and '.join(sorted(found))} may both be the "
                                        f"colour of {name}")
        if found:
            pairs.append((folder / name, folder / found.pop()))
    if not pairs:
        raise UnreadableSourceError(
            f"{folder}: a folder without image pairs; expected depth/ and rgb/ or color/ (TUM "
            "RGB-D, ScanNet, Open3D), or NAME.depth.png beside NAME.color.png")
    return Layout("one folder", _numbered(pairs), PairReading())


def _by_name(depth: Path, color: Path) -> tuple[ImagePair, ...]:
    """Pair the images of two folders by the names, or by the numbers that their names end in."""
    depths, colors = (_images(folder, endings) for folder, endings in
                      ((depth, _DEPTH_ENDINGS), (color, _COLOR_ENDINGS)))
    for key in (lambda stem: stem, _last_number):
        by_key = _unique(colors, key)
        of_depth = _unique(depths, key)
        pairs = [(of_depth[name], by_key[name]) for name in of_depth if name in by_key]
        if pairs:
            return _numbered(sorted(pairs, key=lambda pair: _natural(pair[0].name)))
    raise UnreadableSourceError(
        f"{depth.parent}: none of the {len(depths)} files of depth/ and the {len(colors)} of "
        f"{color.name}/ have the same name")


def _unique(files: Iterable[Path], key: Callable[[str], str]) -> dict[str, Path]:
    """Give files by their key; of a key that two have, none."""
    found: dict[str, Path] = {}
    twice = set()
    for path in files:
        name = key(path.stem)
        if name in found:
            twice.add(name)
        found[name] = path
    return {name: path for name, path in found.items() if name and name not in twice}


def _associated(folder: Path, listed: str) -> tuple[ImagePair, ...]:
    """Read rows of `time rgb/FILE time depth/FILE`, in either order."""
    pairs = []
    for number, words in _rows(folder / listed, 4):
        first, second = ((_seconds(words[at], folder / listed, number),
                          _within(folder, words[at + 1], listed, number)) for at in (0, 2))
        if words[1].startswith("depth"):
            first, second = second, first
        pairs.append((*second, *first))
    return _timed(folder, pairs)


def _nearest(folder: Path, depth_list: str, color_list: str) -> tuple[ImagePair, ...]:
    """Pair the rows `time FILE` of two lists, each depth with the colour nearest in time."""
    depths, colors = (sorted((_seconds(words[0], folder / name, number),
                              _within(folder, words[1], name, number))
                             for number, words in _rows(folder / name, 2))
                      for name in (depth_list, color_list))
    times = [time for time, _ in colors]
    pairs, used = [], set()
    for time, path in depths:
        at = bisect_left(times, time)
        near = min((index for index in (at - 1, at) if 0 <= index < len(times)),
                   key=lambda index: abs(times[index] - time), default=None)
        if near is not None and near not in used and abs(times[near] - time) <= _TUM_NEAR_S:
            used.add(near)
            pairs.append((time, path, *colors[near]))
    return _timed(folder, pairs)


def _timed(folder: Path, pairs: list[tuple[float, Path, float, Path]]) -> tuple[ImagePair, ...]:
    if not pairs:
        raise UnreadableSourceError(f"{folder}: its lists pair no depth with a colour image")
    return tuple(ImagePair(depth, color, round(time * 1e6), round(color_time * 1e6),
                           datetime.fromtimestamp(time, UTC).isoformat()
                           if _EPOCH_S[0] < time < _EPOCH_S[1] else "")
                 for time, depth, color_time, color in pairs)


def _tum_calibration(folder: Path) -> ChosenCalibration:
    third = "freiburg3" in folder.resolve().name
    fx, fy, cx, cy = _TUM_FR3 if third else _TUM_FOCAL
    camera = CameraModel(width=_TUM_SIZE[0], height=_TUM_SIZE[1], fx=fx, fy=fy, cx=cx, cy=cy)
    return ChosenCalibration(
        Calibration(depth=camera, color=camera),
        f"TUM RGB-D's {'freiburg3' if third else 'recommended default'}: focal length {fx:g}")


def _numbered(pairs: Iterable[tuple[Path, Path]]) -> tuple[ImagePair, ...]:
    return tuple(ImagePair(depth, color, number * _PERIOD_US, number * _PERIOD_US)
                 for number, (depth, color) in enumerate(pairs))


def _listed(folder: Path) -> set[str]:
    names = set()
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                names.add(entry.name)
                if len(names) > _MOST_FILES:
                    raise UnreadableSourceError(f"{folder}: more than {_MOST_FILES} files")
    except OSError as error:
        if isinstance(error, UnreadableSourceError):
            raise
        raise UnreadableSourceError(f"{folder}: {error.strerror or error}") from error
    return names


def _images(folder: Path, endings: tuple[str, ...]) -> list[Path]:
    found = [folder / name for name in _listed(folder) if Path(name).suffix.lower() in endings]
    if not found:
        raise UnreadableSourceError(f"{folder}: no images ({' '.join(endings)})")
    return found


def _rows(path: Path, words: int) -> list[tuple[int, list[str]]]:
    """Give the rows of a list that are no comments, each with its number and its first words."""
    try:
        text = read_bounded(path, _MAX_LIST_BYTES).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableSourceError(
            f"{path}: {getattr(error, 'strerror', None) or error}") from error
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        found = line.replace(",", " ").split()
        if len(found) < words:
            raise UnreadableSourceError(f"{path}, line {number}: {line[:60]!r}, expected "
                                        + " ".join(["time FILE"] * (words // 2)))
        rows.append((number, found))
    return rows


def _seconds(word: str, path: Path, number: int) -> float:
    try:
        seconds = float(word)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds < _EPOCH_S[1]:
        raise UnreadableSourceError(f"{path}, line {number}: {word[:30]!r}, expected seconds")
    return seconds


def _within(folder: Path, name: str, listed: str, number: int) -> Path:
    """Give the path that a list names, which must be of a file in the folder."""
    path = Path(os.path.normpath(folder / name))
    if not path.is_relative_to(os.path.normpath(folder)):
        raise UnreadableSourceError(f"{folder / listed}, line {number}: {name[:60]!r} is outside "
                                    "the folder")
    return path


def _natural(name: str) -> list[tuple[int, str]]:
    """Order `9.png` before `10.png`."""
    return [(int(part), "") if part.isdecimal() else (-1, part)
            for part in re.split(r"(\d{1,18})", name) if part]


def _last_number(stem: str) -> str:
    found = re.findall(r"\d+", stem)
    return found[-1].lstrip("0") or "0" if found else ""
