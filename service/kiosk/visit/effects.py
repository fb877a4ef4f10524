"""What a visit wants done; each answer is an event that carries the visit's number."""

from dataclasses import dataclass

__all__ = ["Consented", "Effect", "MakeLinks", "Mirror", "TakePicture", "Withdraw"]


@dataclass(frozen=True)
class Consented:
    """What a visitor agreed to; stored with the capture."""

    text_version: str
    language: str
    retention_s: float | None
    """As shown; None for "not removed by itself"."""
    at: str
    """UTC, ISO 8601."""


@dataclass(frozen=True)
class Mirror:
    """Ask the sensor for pictures from now on, or no more. Never on before the consent."""

    on: bool


@dataclass(frozen=True)
class TakePicture:
    """Press, then wait for the face.

    The answers are `FrameTaken` or `CaptureRefused`, then `FaceCame` or `FaceFailed`. The best
    frame of `best_of_s` seconds is taken, whatever is wrong with it.
    """

    visit: int
    capture_id: str
    best_of_s: float
    consent: Consented | None


@dataclass(frozen=True)
class Withdraw:
    """Remove all of a capture. Repeated until the hub answers, also when the visit is over."""

    visit: int
    capture_id: str


@dataclass(frozen=True)
class MakeLinks:
    """Make links to a capture's files."""

    visit: int
    capture_id: str


Effect = Mirror | TakePicture | Withdraw | MakeLinks
"""In the order given."""
