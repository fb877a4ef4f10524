"""What happens to a visit, besides what its page says (`page_messages.FromPage`)."""

from dataclasses import dataclass

from denseface.service.kiosk.page_messages import KeepScreen, ResultScreen, Trouble
from denseface.service.protocol.hint import Hint

__all__ = [
    "CaptureRefused", "Event", "FaceCame", "FaceFailed", "FrameTaken", "HintCame", "LinksFailed",
    "LinksMade",
    "PageCame", "PageWent", "ServiceIs", "Withdrawn",
]


@dataclass(frozen=True)
class PageCame:
    """A page connects."""


@dataclass(frozen=True)
class PageWent:
    """The page of the visit is closed or loads itself anew."""

    visit: int | None = None
    """The one that the page had; None for the present one."""


@dataclass(frozen=True)
class ServiceIs:
    """What a press now could not have, the worst of it; known from the hub's status."""

    trouble: Trouble | None
    retention_s: float | None = 86400.0


@dataclass(frozen=True)
class HintCame:
    """A frame of the mirror was judged; there is none after `Mirror(on=False)`."""

    hint: Hint
    visit: int | None = None
    """The one whose mirror it was; None for the present one."""


@dataclass(frozen=True)
class FrameTaken:
    """The hub has the frame: there will be a face or a named failure."""

    visit: int
    capture_id: str


@dataclass(frozen=True)
class CaptureRefused:
    """There is no capture and will be none; the reason is that of `press_refused`."""

    visit: int
    capture_id: str
    reason: str
    hint: Hint | None = None


@dataclass(frozen=True)
class FaceCame:
    """The face is there and on its way to the page."""

    visit: int
    capture_id: str
    result: ResultScreen


@dataclass(frozen=True)
class FaceFailed:
    """No face came of the frame: the error's name as in `capture_failed`."""

    visit: int
    capture_id: str
    error: str


@dataclass(frozen=True)
class Withdrawn:
    """The hub has answered that nothing of the capture is left."""

    visit: int
    capture_id: str


@dataclass(frozen=True)
class LinksMade:
    """The links of a capture are there."""

    visit: int
    capture_id: str
    keep: KeepScreen


@dataclass(frozen=True)
class LinksFailed:
    """No links can be made of a capture now."""

    visit: int
    capture_id: str


Event = (PageCame | PageWent | ServiceIs | HintCame | FrameTaken | CaptureRefused | FaceCame
         | FaceFailed | Withdrawn | LinksMade | LinksFailed)
