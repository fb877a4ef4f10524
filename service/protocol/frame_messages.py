"""A kept frame asked for, and given; part of `service.protocol.messages`."""

from typing import Literal

from denseface.service.protocol.message_base import BaseAnswer, BaseRequest, CaptureId
from denseface.service.protocol.payload import FrameHeader


class GetFrame(BaseRequest):
    """Give the frame of a capture: also of one that has no face, or none yet."""

    kind: Literal["get_frame"] = "get_frame"
    capture_id: CaptureId


class FrameKept(BaseAnswer):
    """The answer to `GetFrame`: the frame as the sensor gave it."""

    frame: FrameHeader
    kind: Literal["frame_kept"] = "frame_kept"
    capture_id: CaptureId
