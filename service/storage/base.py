"""A row of the database."""

from dataclasses import dataclass

from denseface.service.protocol.states import CaptureState

__all__ = ["CaptureRow"]


@dataclass(frozen=True)
class CaptureRow:
    """A capture's row."""

    state: CaptureState
    settings_hash: str
    frame_sha256: str
    """Checksum of the frame's file: names what a result must have been made of."""
    attempts: int
    accepted_at: str
    pressed_by: str = ""
    """Fingerprint of the key that pressed; empty where none was needed."""
