"""Pairs of images, infrared and colour, and what is seen of the board in each."""

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from denseface.capture.image_pair import read_grey_image
from denseface.service.errors import UsageError
from denseface.service.tools.calibration._boards import Board, Corners

__all__ = ["BoardView", "Size", "look_for_board", "paired_files"]

_ENDINGS = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".npy"})
_MOST_VIEWS = 200
"""Pairs; twenty are enough, and the time grows with them."""

Size = tuple[int, int]
"""Width and height, pixels."""


class BoardView(NamedTuple):
    """One position of the board, as both cameras see it."""

    name: str
    depth: Corners | None
    """In the depth camera's infrared image; None where the board was not found."""
    color: Corners | None


def paired_files(depth: Sequence[Path], color: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Pair images of two cameras: files in the order given, those of folders by their names.

    Raises
    ------
    UsageError
        A folder is empty, or they cannot be paired.
    """
    of_depth, of_color = _listed(depth), _listed(color)
    folders = all(path.is_dir() for path in (*depth, *color))
    if folders:
        for key in (lambda path: path.stem, _numbers):
            pairs = _by(key, of_depth, of_color)
            if pairs:
                break
    else:
        pairs = list(zip(of_depth, of_color, strict=False))
    if not pairs or (not folders and len(of_depth) != len(of_color)):
        raise UsageError(
            f"{len(of_depth)} infrared images and {len(of_color)} colour images cannot be paired: "
            "expected as many of both, or folders whose files have the same names or numbers")
    if len(pairs) > _MOST_VIEWS:
        raise UsageError(f"{len(pairs)} pairs of images, at most {_MOST_VIEWS} allowed")
    return pairs


def look_for_board(
    pairs: Iterable[tuple[Path, Path]], board: Board, max_pixels: int
) -> tuple[list[BoardView], Size, Size]:
    """Find the board in each pair of images.

    Returns
    -------
    the views, and the sizes of the depth camera's and of the colour camera's images

    Raises
    ------
    CaptureError
        An image cannot be read.
    UsageError
        Images of one camera have different sizes.
    """
    views: list[BoardView] = []
    sizes: dict[str, tuple[Size, Path]] = {}
    for pair in pairs:
        found = []
        for camera, path in zip(("infrared", "colour"), pair, strict=True):
            image = read_grey_image(path, max_pixels)
            size = image.shape[1], image.shape[0]
            first, name = sizes.setdefault(camera, (size, path))
            if size != first:
                raise UsageError(f"{path}: is {size[0]}x{size[1]}, {name} is "
                                 f"{first[0]}x{first[1]}: expected images of one {camera} camera")
            found.append(board.find(image))
        views.append(_aligned(BoardView(pair[0].name, *found)))
    return views, sizes["infrared"][0], sizes["colour"][0]


def _aligned(view: BoardView) -> BoardView:
    """Number the corners of a checkerboard from the same end in both images.

    The cameras of a sensor are the same way up.
    """
    if view.depth is None or view.color is None or len(view.depth.ids) != len(view.color.ids):
        return view
    of_depth, of_color = (corners.pixels[-1] - corners.pixels[0]
                          for corners in (view.depth, view.color))
    if of_depth @ of_color >= 0:
        return view
    return view._replace(color=view.color._replace(pixels=view.color.pixels[::-1].copy()))


def _listed(given: Sequence[Path]) -> list[Path]:
    files: list[Path] = []
    for path in given:
        if path.is_dir():
            found = sorted(one for one in path.iterdir() if one.suffix.lower() in _ENDINGS)
            if not found:
                raise UsageError(f"{path}: no images ({' '.join(sorted(_ENDINGS))})")
            files += found
        else:
            files.append(path)
    return files


def _by(
    key: Callable[[Path], str], first: Sequence[Path], second: Sequence[Path]
) -> list[tuple[Path, Path]]:
    others = {key(path): path for path in second}
    return [(path, others[key(path)]) for path in first if key(path) in others]


def _numbers(path: Path) -> str:
    return " ".join(number.lstrip("0") for number in re.findall(r"\d+", path.stem))
