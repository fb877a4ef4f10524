"""A capture's face from the hub, or a picture that shows why there is none."""

from typing import TYPE_CHECKING

from denseface.service.client import Client
from denseface.service.errors import CaptureFailedError, ServiceError
from denseface.service.export import FaceFiles
from denseface.service.runtime.terminal import complain

if TYPE_CHECKING:
    from denseface.recon.face import Face

__all__ = ["fetch_face"]


def fetch_face(client: Client, capture_id: str, files: FaceFiles, timeout: float) -> "Face":
    """Wait for a capture's face; where there is none, draw its frame, or say how that is done.

    Raises
    ------
    CaptureFailedError
        There is none.
    ServiceError
        As `Client.get`.
    """
    try:
        return client.get(capture_id, timeout=timeout)
    except CaptureFailedError as error:
        if not files.rendering:
            error.args = (f"{error}; `denseface get {capture_id} --preview P.png` draws what was "
                          "looked at",)
            raise
        # Late: it takes the whole reconstruction, and whoever presses waits.
        from denseface.service.tools.reconstruction.refused import draw_failed

        try:
            frame = client.get_frame(capture_id, timeout=timeout)
            draw_failed(files.rendering, frame, str(error), files.mode)
        except ServiceError as failed:
            complain(f"{files.rendering}: not written: {failed}")
        else:
            complain(f"{files.rendering}: picture of the frame, and of what looked like a face")
        raise
