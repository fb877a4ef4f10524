"""What a detector takes for a face, and what the depth says of it."""

from pydantic import BaseModel, ConfigDict

__all__ = ["Box", "FaceCandidate"]

Box = tuple[int, int, int, int]
"""x, y, width, height; pixels."""


class FaceCandidate(BaseModel):
    """A detector's box and what the depth said of it."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    box: Box
    """x, y, width, height; pixels of the colour image."""
    depth_mm: float | None
    """Median depth in the middle of the box; None where nothing was measured."""
    width_mm: float | None
    """The box's width at that depth."""
    verdict: str
    """`chosen`, `farther`, or why it is no face."""
