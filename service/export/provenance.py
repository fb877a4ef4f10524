"""Where a face comes from, as its files say it: short texts, in each format as it can have them."""

from denseface.capture.frame import RgbdFrame
from denseface.recon.face import Report
from denseface.version import VERSION

__all__ = ["PRINTED", "comments", "frame_provenance", "provenance", "stl_header"]

_MAX_COMMENT = 400
"""Characters of a value in a comment: readers of PLY take lines of up to 1023 (rply), 512 (VCG)."""
_STL_HEADER_BYTES = 80

PRINTED = "by denseface, mm, z up"
"""How the header of an STL begins that stands on a printer's bed."""


def provenance(report: Report) -> dict[str, str]:
    """Give what is known of a face's making, in the order in which files tell it.

    Of `generator` (this program and its version), `capture_id`, `captured_at` (ISO 8601, UTC),
    `sensor`, `source` (file and number of the frame, or sensor), `calibration` (which one was used)
    and `settings` (of the reconstruction, JSON). No folder of the machine is named.
    """
    return _known(
        generator=f"denseface {report.version}", capture_id=report.capture_id,
        captured_at=report.captured_at, sensor=report.sensor, source=report.source,
        calibration=report.calibration, settings=report.settings.model_dump_json())


def frame_provenance(frame: RgbdFrame) -> dict[str, str]:
    """Give what is known of a frame that became no face, or not yet one, in the same words."""
    origin = frame.origin
    return _known(
        generator=f"denseface {VERSION}", captured_at=origin.captured_at,
        sensor=origin.sensor, source=origin.source, calibration=frame.calibration_origin)


def _known(**told: str) -> dict[str, str]:
    return {name: text for name, text in told.items() if text}


def comments(report: Report) -> list[str]:
    """Give `provenance` as lines of ASCII, `NAME VALUE`, that a file's header can have."""
    # A line that ends in a backslash would go on in the next one, in an OBJ.
    return [f"{name} {_ascii(text)[:_MAX_COMMENT]}".rstrip("\\ ")
            for name, text in provenance(report).items()]


def stl_header(report: Report, begin: str = "by denseface, mm") -> bytes:
    """Give the 80 bytes at the start of a binary STL: `begin`, and of the rest what they take.

    It never begins with `solid`, by which readers know an STL that is text.
    """
    header = begin
    told = provenance(report)
    for name in ("captured_at", "source", "sensor", "capture_id"):
        if name in told and len(longer := f"{header}; {_ascii(told[name])}") <= _STL_HEADER_BYTES:
            header = longer
    return header.encode().ljust(_STL_HEADER_BYTES, b"\0")


def _ascii(text: str) -> str:
    """Give a line of printable ASCII; other characters as Python escapes them."""
    line = "".join(one if one.isprintable() else " " for one in text)
    return line.encode("ascii", "backslashreplace").decode()
