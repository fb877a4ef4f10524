"""What is chosen of a print: which solid, how thick, how large."""

from dataclasses import dataclass
from typing import Literal, get_args

from denseface.arguments import describe
from denseface.service.errors import UsageError

__all__ = ["ENDINGS", "HEIGHT_MM", "SOLIDS", "WALL_MM", "Printing", "SolidKind",
           "check_printable"]

ENDINGS = (".stl", ".3mf")
"""Of the files that hold what is printed."""
SolidKind = Literal["plate", "mask", "open"]
SOLIDS: tuple[SolidKind, ...] = get_args(SolidKind)
WALL_MM = (0.8, 10.0)
"""Thinnest and thickest: two lines of the usual nozzle of 0.4 mm are the least that holds."""
HEIGHT_MM = (10.0, 500.0)
"""Of the face, as printed: no usual printer takes more."""


@dataclass(frozen=True)
class Printing:
    """How a face becomes a solid.

    Attributes
    ----------
    solid : `plate`, the face as a relief on a flat plate, which prints without supports; `mask`, a
        hollow mask; or `open`, no solid but the dense surface as it was measured, in the camera's
        frame, of `.stl` alone
    wall_mm : thickness of the mask's wall, nowhere below 0.93 of this, or of the plate, as printed
    height_mm : from the face's lowest to its highest point, as printed; None for life size

    Raises
    ------
    UsageError
        A value is none of these.
    """

    solid: SolidKind = "plate"
    wall_mm: float = 2.0
    height_mm: float | None = None

    def __post_init__(self) -> None:
        if self.solid not in SOLIDS:
            raise UsageError(f"solid: expected {', '.join(SOLIDS[:-1])} or {SOLIDS[-1]}, found "
                             f"{describe(self.solid)}")
        _check_length("wall_mm", self.wall_mm, WALL_MM)
        if self.height_mm is not None:
            _check_length("height_mm", self.height_mm, HEIGHT_MM)
        if self.solid == "open" and (self.wall_mm, self.height_mm) != (2.0, None):
            raise UsageError("wall_mm, height_mm: expected with a plate or a mask; solid is open")


def _check_length(name: str, given: object, bounds: tuple[float, float]) -> None:
    low, high = bounds
    if isinstance(given, bool) or not isinstance(given, int | float) or not low <= given <= high:
        raise UsageError(f"{name}: expected millimetres from {low:g} to {high:g}, found "
                         f"{describe(given)}")


def check_printable(ending: str, printing: Printing) -> None:
    """Raise UsageError where a file of this ending cannot hold what is chosen."""
    if ending == ".3mf" and printing.solid == "open":
        raise UsageError("solid: expected plate or mask, found open: a .3mf holds a solid, an .stl "
                         "the open surface too")
