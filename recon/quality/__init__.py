"""Before a frame is taken: is a face there, where, how turned, how still, how lit."""

from typing import TYPE_CHECKING

from denseface.recon.quality._quality import FaceQuality, Quality, Sight

if TYPE_CHECKING:
    from denseface.recon.quality._measure import measure

__all__ = ["FaceQuality", "Quality", "Sight", "measure"]


def __getattr__(name: str) -> object:
    if name != "measure":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # With all that finds faces: who only goes by what was measured needs none of it.
    from denseface.recon.quality._measure import measure

    return measure


def __dir__() -> list[str]:
    return __all__
