"""What is known of a capture's attempts, and whether a worker's face can be their answer."""

import math
from dataclasses import dataclass, field

from denseface.recon.face import Report
from denseface.recon.settings import Settings
from denseface.service.errors import RemoteProtocolError
from denseface.service.protocol import messages
from denseface.service.protocol.payload import Arrays, FrameHeader

_CLOCKS_S = 1.0
"""By so much a worker's clock may run ahead of the hub's during one job, seconds."""
_ROUNDING = 1e-6
"""Relative difference of two numbers that are one."""
_R0_FACTORS = (2.0, 40.0)
"""Least and largest R0 in spacings where the worker may choose it."""


@dataclass(frozen=True)
class JobFacts:
    """What a job says, by which its answer is judged."""

    settings: Settings
    frame: FrameHeader
    sent: float = -math.inf
    """When it was sent first, seconds; long ago where another hub did that."""


@dataclass
class Attempts:
    """What this hub knows of a capture's attempts."""

    last_error: tuple[str, str] | None = None
    """Error and reason of the last one that failed, for a dead letter."""
    handed_back: int = 0
    """How often a worker gave it back and it counted for none."""
    keys: set[str] = field(default_factory=set)
    """Fingerprints of the keys to whose workers it was sent."""
    by_earlier_hub: bool = False
    """Whether an earlier hub sent it too, nobody knows to whom."""
    facts: JobFacts | None = None
    """Of the job; None before this hub sent it."""


def check_result(
    message: messages.Result, arrays: Arrays, facts: JobFacts, now: float
) -> None:
    """Check a face against itself and against the job that it answers.

    Whatever can be told again in a fraction of the time that the face took: that the points are
    those of the frame cannot.

    Raises
    ------
    RemoteProtocolError
        Where its parts make no face, or its report says something that is not so.
    """
    message.face.check(arrays)
    report = message.face.report
    wrong = (_of_another_job(report, message.capture_id, facts)
             or _wrong_numbers(report)
             or _wrong_times(report.timings_ms, now - facts.sent))
    if wrong:
        raise RemoteProtocolError(f"face: the report {wrong}")


def _of_another_job(report: Report, capture_id: str, facts: JobFacts) -> str | None:
    frame = facts.frame
    if report.capture_id not in ("", capture_id):  # `reconstruct` knows of no captures
        return f"is of capture {report.capture_id[:64]!a}"
    if report.settings != facts.settings:
        return "has other settings than the job"
    if report.calibration != frame.calibration_origin:
        return "has another calibration than the frame"
    for name in ("sensor", "captured_at", "source"):
        # An older worker says nothing of a source.
        if getattr(report, name) not in ("", getattr(frame, name)):
            return f"has another {name} than the frame"
    if report.skew_us != frame.depth_timestamp_us - frame.color_timestamp_us:
        return f"has a skew of {report.skew_us} us, the frame another"
    x, y, width, height = report.face_box
    image = frame.calibration.color
    if not (0 < width <= 2 * image.width and 0 < height <= 2 * image.height
            and -width < x < image.width and -height < y < image.height):
        return f"has the face at {report.face_box}, outside the image"
    return None


def _wrong_numbers(report: Report) -> str | None:
    if report.mean_spacing_mm <= 0 or report.noise_mm < 0:
        return "has a spacing or noise below zero"
    factor = report.settings.r0_factor
    least, most = (one * report.mean_spacing_mm
                   for one in ((factor, factor) if factor else _R0_FACTORS))
    if not least * (1 - _ROUNDING) <= report.r0_mm <= most * (1 + _ROUNDING):
        return (f"has R0 {report.r0_mm:g} mm, its spacing and settings make {least:g} to "
                f"{most:g} mm")
    if report.candidates and report.candidates[0].box != report.face_box:
        return "has chosen another box than the face's"
    return None


def _wrong_times(timings_ms: dict[str, float], passed_s: float) -> str | None:
    stages = sum(taken for name, taken in timings_ms.items() if name != "total")
    total = timings_ms.get("total", stages)
    if stages > total * (1 + _ROUNDING):
        return "has stages that took longer than all"
    if total > (passed_s + _CLOCKS_S) * 1000:
        return "has times longer than the job was out"
    return None
