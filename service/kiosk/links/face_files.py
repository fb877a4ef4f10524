"""The files that a face is fetched as, made when they are asked for: nothing of them is kept."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Literal, get_args

from denseface.recon.face import Face
from denseface.service.errors import (
    CaptureFailedError,
    ClientTimeoutError,
    RequestFailedError,
    ServiceError,
    UnknownCaptureError,
)
from denseface.service.export.formats import face_bytes
from denseface.service.export.render import portrait

__all__ = ["FORMATS", "MEDIA_TYPES", "FaceFiles", "Format", "NoFaceError", "TryLaterError"]

Format = Literal["glb", "png", "stl", "ply"]
FORMATS: tuple[Format, ...] = get_args(Format)
"""In the order in which they are offered."""
MEDIA_TYPES: dict[Format, str] = {
    "glb": "model/gltf-binary",
    "png": "image/png",
    "stl": "model/stl",
    "ply": "application/octet-stream",  # none is registered
}
_PICTURE_SIDE = 1200
"""Width and height of the picture, pixels."""
_MAX_WAITING = 8
"""Downloads that wait for their file to be made, beyond which one is told to come later."""
_MAX_HELD = 4
"""Files in memory at once: a GLB of 150,000 points has 8 MB."""
_PATIENCE_S = 30.0
"""Longest wait for a place among those, seconds."""


class NoFaceError(ServiceError, LookupError):
    """The hub has no face of this capture, or no more."""


class TryLaterError(ServiceError, TimeoutError):
    """The hub does not answer, or too many files are asked for."""


class FaceFiles:
    """Makes files of faces, one at a time, and at most a few in memory.

    Parameters
    ----------
    get : gives a capture's face, as `AsyncClient.get`
    """

    def __init__(self, get: Callable[[str], Awaitable[Face]]) -> None:
        self._get = get
        self._held = asyncio.Semaphore(_MAX_HELD)
        self._making = asyncio.Lock()
        self._waiting = 0

    async def hold(self) -> None:
        """Take a place for one file; `release` gives it back. TryLaterError where none is free."""
        if self._waiting >= _MAX_WAITING:
            raise TryLaterError("too many files are asked for")
        self._waiting += 1
        try:
            async with asyncio.timeout(_PATIENCE_S):
                await self._held.acquire()
        except TimeoutError as error:
            raise TryLaterError("too many files are being fetched") from error
        finally:
            self._waiting -= 1

    def release(self) -> None:
        """Give a place back, once the file is not needed any more."""
        self._held.release()

    async def make(self, capture_id: str, kind: Format) -> bytes:
        """Make a file of a capture's face, which is asked of the hub each time.

        Raises
        ------
        NoFaceError
            The hub says that there is none, or no more.
        TryLaterError
            The hub does not answer.
        """
        async with self._making:
            try:
                face = await self._get(capture_id)
            except (UnknownCaptureError, CaptureFailedError) as error:
                raise NoFaceError(str(error)) from error
            except (ClientTimeoutError, RequestFailedError) as error:
                raise TryLaterError(str(error)) from error
            return await asyncio.to_thread(_file_of, face, kind)


def _file_of(face: Face, kind: Format) -> bytes:
    if kind == "png":
        return portrait(face, _PICTURE_SIDE)
    return face_bytes(face, f".{kind}")
