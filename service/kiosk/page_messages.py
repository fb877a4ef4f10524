"""What page and server say to each other over the WebSocket: `docs/kiosk.md` says when.

All are JSON texts but pictures and faces, which are binary: one byte (`MIRROR` or `FACE`), the
length of a JSON object (4 bytes, little-endian), that object, and a JPEG or a face's grid.
"""

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from denseface.service.kiosk.language import Language
from denseface.service.protocol.hint import Code
from denseface.service.protocol.message_base import CaptureId, Number

__all__ = [
    "FACE", "FROM_PAGE", "MIRROR", "Again", "Arrow", "Begin", "Cancel", "Consent", "ConsentScreen",
    "CountdownScreen", "Delete", "Done", "Drawn", "FaceHead", "FailedScreen", "FromPage", "Hello",
    "Keep", "KeepScreen", "Link", "Measurement", "MirrorHead", "Next", "PositionScreen",
    "Press", "ResultScreen", "Screen", "ScreenName", "ThanksScreen", "Touch", "Trouble",
]

MIRROR, FACE = 1, 2
"""First byte of a binary message."""


class _Said(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


# --- page to server

class _FromPage(_Said):
    visit: Number
    """The visit that the page shows: what is said of another one changes nothing."""


class Begin(_FromPage):
    """The large button of the first screen."""

    kind: Literal["begin"] = "begin"


class Consent(_FromPage):
    """Yes or no, and the language in which the question was read."""

    kind: Literal["consent"] = "consent"
    agreed: bool
    language: Language


class Press(_FromPage):
    """The button, on the screen or as a key: begins a visit, or takes the picture."""

    kind: Literal["press"] = "press"


class Next(_FromPage):
    """The last picture of the mirror is drawn: send the next one. At most one is under way."""

    kind: Literal["next"] = "next"


class Touch(_FromPage):
    """Somebody is there: a timer begins anew. The page says so at most twice a second."""

    kind: Literal["touch"] = "touch"


class Cancel(_FromPage):
    """Back to the first screen; a picture that was taken is withdrawn."""

    kind: Literal["cancel"] = "cancel"


class Drawn(_FromPage):
    """The first mesh of a face is on the screen."""

    kind: Literal["drawn"] = "drawn"
    capture_id: CaptureId


class Again(_FromPage):
    """Take another picture, with the same consent."""

    kind: Literal["again"] = "again"


class Keep(_FromPage):
    """Make links to fetch the face by."""

    kind: Literal["keep"] = "keep"


class Delete(_FromPage):
    """Withdraw the consent: remove frame, face, row and links now."""

    kind: Literal["delete"] = "delete"


class Done(_FromPage):
    """The visitor has seen enough."""

    kind: Literal["done"] = "done"


FromPage = (Begin | Consent | Press | Next | Touch | Cancel | Drawn | Again | Keep | Delete | Done)
FROM_PAGE: TypeAdapter[FromPage] = TypeAdapter(Annotated[FromPage, Field(discriminator="kind")])
"""Checks what a page says: at most 4 KiB of JSON."""


# --- server to page

class ScreenName(StrEnum):
    """What a page shows."""

    ATTRACT = "attract"
    CONSENT = "consent"
    POSITION = "position"
    COUNTDOWN = "countdown"
    CAPTURED = "captured"
    """The frame is taken: from the exposure until the hub has it."""
    RECONSTRUCTING = "reconstructing"
    RESULT = "result"
    KEEP = "keep"
    """The result, with links."""
    DELETING = "deleting"
    """Until the hub has answered."""
    FAILED = "failed"
    """No face came of the picture; it goes on by itself."""
    THANKS = "thanks"
    BUSY = "busy"
    """Another page has the visit; it goes on by itself."""


class Trouble(StrEnum):
    """What is gone. On every screen, until it is back; nothing is to be done about it there."""

    SENSOR = "sensor"
    WORKER = "worker"
    HUB = "hub"
    DISK = "disk"
    """The hub takes no more pictures."""


class Arrow(StrEnum):
    """Where the visitor is to go, as seen in the mirror."""

    LEFT = "left"
    RIGHT = "right"
    UP = "up"
    DOWN = "down"
    CLOSER = "closer"
    BACK = "back"


class ConsentScreen(_Said):
    """What is agreed to."""

    retention_s: Annotated[float, Field(gt=0)] | None
    """How long a capture is kept; None where it is not removed by itself."""
    text_version: Annotated[str, Field(max_length=64)]
    """Of the text: `built-in-1`, or the operator's own."""
    text: Annotated[dict[Language, tuple[str, ...]], Field(max_length=64)] | None = None
    """The operator's own paragraphs by language; None where the page's are shown."""
    links: bool = False
    """Whether the face can be fetched by links."""


class PositionScreen(_Said):
    """How to stand better."""

    hint: Code | None = None
    """The gate's code of what to do; the page has the words under `hint.CODE`. None: all well."""
    arrow: Arrow | None = None
    progress: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Of the ring."""
    can_press: bool = False
    """Whether the button takes a picture now."""
    with_warnings: bool = False
    """The button takes the best there is: it has taken long."""


class CountdownScreen(_Said):
    """Counts down; 0 is the picture."""

    left: Annotated[int, Field(ge=0, le=10)]


class Measurement(_Said):
    """A length on the face."""

    name: Code
    """The page has the words under `measurement.NAME`."""
    value_mm: float
    low_mm: float
    """Lower end of the 95 % interval."""
    high_mm: float


class ResultScreen(_Said):
    """What is shown of the face, whose grid comes as a binary message before."""

    capture_id: CaptureId
    warnings: tuple[Code, ...] = ()
    """What was wrong with the frame."""
    initial_points: Number = 0
    dense_points: Number = 0
    can_keep: bool = False
    no_links: bool = False
    """Links were asked for, and none can be made now."""
    measurements: tuple[Measurement, ...] | None = None
    """None where the operator does not offer them."""


class Link(_Said):
    """Where one form of the face is fetched."""

    format: Annotated[str, Field(max_length=16)]
    """`glb`, `ply`, `stl` or `png`."""
    url: Annotated[str, Field(max_length=500)]


class KeepScreen(_Said):
    """Links, of which `page` leads to all of them."""

    page: Annotated[str, Field(max_length=500)]
    qr: tuple[str, ...]
    """The QR code of `page`, a string of 0 and 1 for each row, without the quiet zone."""
    links: tuple[Link, ...] = ()
    uses: Number
    expires_s: Annotated[float, Field(ge=0)]


class FailedScreen(_Said):
    """Why there is no face."""

    why: Code
    """`no_face`, `sensor`, `quality`, `busy`, `failed`: the page has the words."""
    hint: Code | None = None


class ThanksScreen(_Said):
    """What became of the capture."""

    deleted: bool | None = None
    """True where the hub has said that nothing is left; None where nothing was taken."""
    retention_s: float | None = None


class Screen(_Said):
    """The whole of what a page shows; sent at each change, and to a page that connects."""

    kind: Literal["screen"] = "screen"
    visit: Number
    """Rises with every visit, and repeats in all that a page says of it."""
    name: ScreenName
    trouble: Trouble | None = None
    leaving_s: Annotated[float, Field(ge=0)] | None = None
    """"Still there?": time left before the first screen comes; None while that is far."""
    consent: ConsentScreen | None = None
    position: PositionScreen | None = None
    countdown: CountdownScreen | None = None
    result: ResultScreen | None = None
    keep: KeepScreen | None = None
    failed: FailedScreen | None = None
    thanks: ThanksScreen | None = None


class Hello(_Said):
    """The first message to a page: what the operator has set."""

    kind: Literal["hello"] = "hello"
    languages: tuple[Language, ...]
    """The first is the default; each is fetched from `/languages/NAME.json`."""
    sound: bool = False
    speech: bool = True
    """Whether hints may be spoken, where the visitor asks for it."""
    version: Annotated[str, Field(max_length=64)]
    """Of the server: a page of another version loads itself anew."""


class MirrorHead(_Said):
    """Before a picture's JPEG, which is not mirrored: the page does that."""

    timestamp_us: int
    """Of the sensor's clock."""
    width: Number
    height: Number


class FaceHead(_Said):
    """Before a face's grid."""

    capture_id: CaptureId
    visit: Number
