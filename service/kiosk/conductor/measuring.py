"""The lengths on a face as a page shows them."""

from dataclasses import fields

from denseface.recon.face import Face
from denseface.service.kiosk.page_messages import Measurement

__all__ = ["measurements_of", "prepare"]

# What measures is imported where it is asked for: compiled loops cost a second and 80 MB.


def prepare() -> None:
    """Load what measures, so that the first visitor does not wait for it."""
    from denseface.recon.measurement import warm
    warm()


def measurements_of(face: Face) -> tuple[Measurement, ...]:
    """Give what was measured on a face, in the order of `Measurements`; empty where nothing was."""
    from denseface.recon.measurement import measure
    found = measure(face)
    lengths = {field.name: getattr(found, field.name) for field in fields(found)}
    return tuple(Measurement(name=name, value_mm=round(length.value_mm, 1),
                             low_mm=round(length.low_mm, 1), high_mm=round(length.high_mm, 1))
                 for name, length in lengths.items() if length is not None)
