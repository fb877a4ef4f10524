"""From what was asked for to what is said and written: `denseface compare`."""

from pathlib import Path
from typing import NamedTuple

from denseface.service.errors import UsageError
from denseface.service.export import check_outputs
from denseface.service.export.written import describe_file
from denseface.service.runtime.terminal import complain
from denseface.service.runtime.terminal.progress import Progress
from denseface.service.tools.comparison.comparing import compare_surfaces
from denseface.service.tools.comparison.sides import Capture, Reading, read_side
from denseface.service.tools.comparison.told import ENDINGS, Told
from denseface.service.tools.reconstruction.refused import write_named

__all__ = ["Request", "compare"]

_WHAT = {".html": "page of the comparison", ".json": "figures of the comparison",
         ".png": "picture of the differences", ".ply": "cloud in the differences' colours"}


class Request(NamedTuple):
    """What is to be compared, and where the results go."""

    before: str
    after: str
    outputs: tuple[Path, ...]
    confidence: float
    beyond_mm: float


def compare(request: Request, reading: Reading) -> tuple[list[str], list[str]]:
    """Compare, write what is asked for, and give what there is to say, and to warn of.

    Raises
    ------
    UsageError, StoreError
        An output cannot be written, or both sides are one file.
    UsageError, CaptureError, FormatError, ServiceError, ReconstructionError
        As `read_side` and `compare_surfaces`.
    """
    for path in request.outputs:
        if path.suffix.lower() not in ENDINGS:
            raise UsageError(f"{path}: ending {path.suffix or 'missing'}, expected one of "
                             f"{' '.join(ENDINGS)}")
        if any(given and path.resolve() == Path(given).resolve()
               for given in (request.before, request.after)):
            raise UsageError(f"{path}: is read, and would be replaced by what is written: name "
                             "another place")
    check_outputs(*((path, None) for path in request.outputs))
    doubts: list[str] = []
    sides: list[list[Capture]] = []
    for given in (request.before, request.after):
        with Progress(f"reading {given}"):
            sides.append(read_side(given, reading, doubts.append))
    before, after = sides
    every = [*before, *after]
    for capture in every:
        if capture.face is not None:
            doubts += [line for warning in capture.face.report.warnings
                       if (line := f"{capture.name}: {warning}") not in doubts]
    with Progress("comparing", total=len(every), unit="captures") as progress:
        result = compare_surfaces(
            [one.surface for one in before], [one.surface for one in after],
            confidence=request.confidence, beyond_mm=request.beyond_mm,
            names=[one.name for one in every], done=progress.advance)
    told = Told(result, before[0].surface, [one.name for one in before],
                [one.name for one in after])
    for path in request.outputs:
        write_named(path, told.bytes_of(path.suffix.lower()))
        complain(describe_file(path, _WHAT[path.suffix.lower()]))
    return told.lines(), [*doubts, *result.warnings]
