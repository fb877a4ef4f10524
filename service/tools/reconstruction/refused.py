"""What is said and drawn of a frame that became no face."""

from collections import Counter
from pathlib import Path

from denseface.capture import RgbdFrame
from denseface.files import write_whole
from denseface.recon import ReconstructionError, reconstruct
from denseface.recon.face import FaceCandidate
from denseface.service.errors import StoreError, reason_of
from denseface.service.export.refusal import draw_refusal

__all__ = ["draw_failed", "draw_refused", "explained", "write_named"]

_TOLD = {"chosen": "taken", "farther": "farther away"}
"""Verdicts that need other words where there is no face in the end."""


def draw_refused(
    path: Path, frame: RgbdFrame, error: ReconstructionError, name: str, mode: int | None = None
) -> None:
    """Write the picture of a frame without a face.

    Parameters
    ----------
    name : of the frame
    mode : of the file; None for 666 less the umask

    Raises
    ------
    StoreError
        It cannot be written.
    """
    write_named(path, draw_refusal(frame, error.candidates, f"{name}: {error}"), mode)


def draw_failed(path: Path, frame: RgbdFrame, reason: str, mode: int | None = None) -> None:
    """Write the picture of a frame that became no face elsewhere: what looked like one is sought.

    Raises
    ------
    StoreError
        It cannot be written.
    """
    candidates: tuple[FaceCandidate, ...] = ()
    try:
        reconstruct(frame)
    except ReconstructionError as error:
        candidates = error.candidates
    write_named(path, draw_refusal(frame, candidates, reason), mode)


def write_named(path: Path, data: bytes, mode: int | None = None) -> None:
    """Write a whole file; StoreError, which names it, where that fails."""
    try:
        write_whole(path, [data], mode=mode)
    except OSError as failed:
        raise StoreError(f"{path}: {reason_of(failed)}") from failed


def explained(
    error: ReconstructionError, name: str, *, frames: int | None, picture: Path | None
) -> ReconstructionError:
    """Give an error that names file and frame, what looked like a face, and what to try.

    Parameters
    ----------
    name : file and frame
    frames : how many the source has
    picture : where it was drawn; None where it was not
    """
    text = f"{name}: {error}"
    if len(error.candidates) > 1:
        verdicts = Counter(_TOLD.get(one.verdict, one.verdict) for one in error.candidates)
        text += " (" + ", ".join(f"{times} boxes: {what}" if times > 1 else f"1 box: {what}"
                                 for what, times in verdicts.most_common()) + ")"
    tries = []
    if frames is not None and frames > 1:
        tries.append(f"--frame takes another of its {frames} frames, --all-frames each")
    if any("size" in one.verdict for one in error.candidates):
        tries.append("--calibration FILE where its cameras are others than assumed")
    tries.append(f"{picture} shows what was looked at" if picture else
                 "--preview P.png draws what was looked at")
    told = type(error)(f"{text}{' ' if text.endswith('?') else '; '}{'; '.join(tries)}")
    told.candidates = error.candidates
    return told
