"""What an operator may set of a visit."""

from dataclasses import dataclass, fields

from denseface.service.kiosk.language import Language

__all__ = ["VisitOptions"]


@dataclass(frozen=True)
class VisitOptions:
    """All times in seconds.

    Raises
    ------
    ValueError
        A time is not above 0, or the countdown or the window is out of its bounds.
    """

    consent: bool = True
    """Whether it is asked at all."""
    text_version: str = "built-in-1"
    """Of the text of the consent."""
    text: dict[Language, tuple[str, ...]] | None = None
    """The operator's own paragraphs by language; None where the page's are shown."""
    links: bool = False
    """Whether faces can be fetched by links."""
    auto: bool = True
    """Whether a picture is taken without a press, of somebody who stands well."""
    countdown: int = 3
    """Where it begins, at most 10; 0 takes the picture at once."""
    best_of_s: float = 1.0
    """The picture is the best frame of so long a time, at most 1. The gate ends it 0.3 s after the
    first frame with nothing wrong, so that what is taken is seldom older than that: the time
    counts in the second from exposure to face."""
    anyhow_best_of_s: float = 0.3
    """The same where something is wrong all the time: the best frame may be the first."""
    sample_gap_s: float = 0.3
    """Between two good samples; where all in between are good as well a picture is taken."""
    slow_s: float = 15.0
    """After so long without a good sample the button takes the best there is."""
    lost_s: float = 0.7
    """A countdown ends when no face was seen for so long: a hand that comes back from the button
    hides it for less."""
    consent_s: float = 60.0
    """Without a touch the first screen comes after this and the following times; this one is for
    somebody who reads."""
    position_s: float = 30.0
    """Also begins anew with each sample that shows a face."""
    position_longest_s: float = 180.0
    """The same without regard to faces: a poster on the wall has one."""
    waiting_s: float = 60.0
    """While the face is computed."""
    result_s: float = 90.0
    keep_s: float = 120.0
    """A code is to be found, a telephone to be fetched."""
    deleting_s: float = 60.0
    leaving_s: float = 10.0
    """So long before the first screen comes it is asked whether somebody is still there."""
    answer_s: float = 20.0
    """A picture that is not there after so long is given up."""
    feedback_s: float = 0.4
    """How long "taken" is shown at least, unless the face is there before."""
    failed_s: float = 6.0
    """Time to read why there is no face; then it goes on by itself."""
    thanks_s: float = 6.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name.endswith("_s") and not getattr(self, field.name) > 0:
                raise ValueError(f"{field.name} must be above 0")
        if not 0 <= self.countdown <= 10:
            raise ValueError("countdown must be from 0 to 10")
        for name in ("best_of_s", "anyhow_best_of_s"):
            if getattr(self, name) > 1:
                raise ValueError(f"{name} must be at most 1")
