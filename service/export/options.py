"""What may be asked of a face's file, beside its format."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, Union, cast, get_args

from denseface.arguments import describe, expect
from denseface.service.errors import UsageError
from denseface.service.export.printing import Printing

if TYPE_CHECKING:
    from denseface.capture.frame import RgbdFrame

__all__ = ["HOLES", "LIKENESS", "PLAIN", "ExportOptions", "Holes", "Texture"]

Holes = Literal["leave", "close"]
Texture = Union["RgbdFrame", Literal["points"]]
HOLES: tuple[Holes, ...] = get_args(Holes)
"""What may be done about holes of a mesh."""
LIKENESS = "The likeness of a person: pass it on only as they agreed to"
"""What a file says of its rights where nobody says otherwise."""
_MAX_COPYRIGHT = 400
"""Characters."""


@dataclass(frozen=True)
class ExportOptions:
    """What is asked of a file; a format that cannot have it refuses (`check_options`).

    Attributes
    ----------
    holes : of a mesh: `leave` them, or `close` those that the face has all around, by a smooth
        surface of points of which nothing was measured
    texture : of `.glb` and `.obj`, in place of a colour for each point: the frame that the face was
        made of, whose colour image becomes the mesh's texture at full resolution; or `points`, for
        an image of the points' own colours, which programs show that know no colours of points
    compact : of `.glb`: a tenth of the size, by EXT_meshopt_compression; points are rounded to a
        seventh of a grid step, 0.03 mm off at most at 0.7 m, and colours become a JPEG
    copyright : of `.glb`: who has the rights, `asset.copyright`
    printing : of `.stl` and `.3mf`: which solid, how thick, how large

    Raises
    ------
    UsageError
        Where a value is none of these.
    """

    holes: Holes = "leave"
    texture: "Texture | None" = None
    compact: bool = False
    copyright: str = LIKENESS
    printing: Printing = field(default_factory=Printing)

    def __post_init__(self) -> None:
        if self.holes not in HOLES:
            raise UsageError(f"holes: expected {' or '.join(HOLES)}, found {describe(self.holes)}")
        text = self.copyright
        if not isinstance(text, str) or len(text) > _MAX_COPYRIGHT or not text.isprintable():
            raise UsageError(f"copyright: expected a line of at most {_MAX_COPYRIGHT} characters, "
                             f"found {describe(text)}")
        if self.texture not in (None, "points"):
            from denseface.capture.frame import RgbdFrame

            expect("texture", self.texture, RgbdFrame)
            if cast("RgbdFrame", self.texture).color is None:
                raise UsageError("texture: the frame has no colour image")

    @property
    def asked(self) -> set[str]:
        """What differs from `PLAIN`."""
        return {name for name in ("holes", "texture", "compact", "copyright", "printing")
                if getattr(self, name) != getattr(PLAIN, name)}


PLAIN = ExportOptions()
"""What is written where nothing is said."""
