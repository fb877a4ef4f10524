"""A face by what a user calls it: a file, or a capture that the hub keeps."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.client import Client
from denseface.service.errors import UsageError
from denseface.service.export import FaceFiles, load_face
from denseface.service.tools.fetch import fetch_face

if TYPE_CHECKING:
    from denseface.capture.frame import RgbdFrame
    from denseface.recon.face import Face

__all__ = ["take_face"]

_TIMEOUT_S = 60.0
"""Longest wait for a face that is being made."""
_OF_PATHS = "./~\\"
"""What no id of a capture has."""


def take_face(
    named: str, connect: Callable[[], Client], files: FaceFiles
) -> "tuple[Face, RgbdFrame | None]":
    """Read a face, or fetch it with the frame that its texture needs.

    Raises
    ------
    UsageError
        It would be replaced by what is written, or a texture is asked for of a file, which has no
        frame.
    FormatError
        The file is missing, damaged, or no face.
    ServiceError
        As `fetch_face`.
    """
    path = Path(named)
    if path.exists() or any(one in named for one in _OF_PATHS):
        if files.textured:
            raise UsageError(f"{named}: has no colour image for a texture: name a capture, or the "
                             "frame with `denseface reconstruct`")
        if any(out and out.exists() and out.samefile(path) for out in (
                files.output, files.report, files.rendering) if path.exists()):
            raise UsageError(f"{named}: is read, and would be replaced by what is written: name "
                             "another place")
        return load_face(path), None
    with connect() as client:
        frame = client.get_frame(named, timeout=_TIMEOUT_S) if files.textured else None
        return fetch_face(client, named, files, _TIMEOUT_S), frame
