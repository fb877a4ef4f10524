"""From what was asked for to tables and files: `denseface evaluate`."""

from pathlib import Path

from denseface.service.errors import ServiceError, UsageError
from denseface.service.export import check_outputs
from denseface.service.runtime.terminal import complain, say
from denseface.service.runtime.terminal.progress import Progress
from denseface.service.tools.evaluation.evaluating import Plan, evaluate_inputs
from denseface.service.tools.evaluation.told import Told
from denseface.service.tools.evaluation.truth import Truth
from denseface.service.tools.reconstruction.refused import write_named

__all__ = ["evaluate"]

_FAILED = 1
_FILES = ("report.html", "evaluation.csv", "evaluation.json")


def evaluate(plan: Plan, truth: Path, unit: str, folder: Path | None) -> int:
    """Evaluate, print the table, write the files, and give the exit status.

    0 where each frame became a face; 1 where one did not.

    Raises
    ------
    UsageError, CaptureError, FormatError, StoreError
        An input or the truth cannot be read, or the folder not be written.
    """
    if folder is not None:
        if folder.exists() and not folder.is_dir():
            raise UsageError(f"{folder}: is a file, expected a folder")
        check_outputs(*((folder / name, None) for name in _FILES))
    told = Told(Truth.read(truth, unit), pictured=folder is not None)
    doubts: list[str] = []
    say(told.head(), flush=True)
    with Progress("evaluating") as progress:
        for one in evaluate_inputs(plan, told.truth, doubts.append):
            say(told.line(told.add(one)), flush=True)
            progress.advance()
    for line in doubts:
        complain(f"warning: {line}")
    if not told.rows:
        raise ServiceError("no face to evaluate in what was given")
    say("", *told.closing())
    if folder is not None:
        for name, data in zip(_FILES, (told.html(), told.csv(), told.json()), strict=True):
            write_named(folder / name, data)
        for name, data in told.pictures.items():
            write_named(folder / name, data)
        say(f"{folder}/: {', '.join(_FILES)} and {len(told.pictures)} error "
            f"map{'s' * (len(told.pictures) != 1)}; any browser opens report.html")
    return _FAILED if doubts else 0
