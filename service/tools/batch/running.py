"""A batch from its first frame to its last: `denseface batch`."""

import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.missing import explained
from denseface.service.runtime.files import private_folder
from denseface.service.runtime.terminal import complain, say
from denseface.service.tools.batch.counting import Counting
from denseface.service.tools.batch.engines.clusters import (
    TlsFiles,
    check_scheduler,
    local_engine,
    remote_engine,
)
from denseface.service.tools.batch.engines.engine import Engine
from denseface.service.tools.batch.inputs import absolute, parts_of
from denseface.service.tools.batch.losses import Losses
from denseface.service.tools.batch.manifest import claim_folder
from denseface.service.tools.batch.parts import Part, Task
from denseface.service.tools.batch.plan import Plan
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.schedule import Schedule
from denseface.service.tools.batch.worker.records import FACES, RECORDS
from denseface.service.tools.batch.worker.words import WORDS, last_words
from denseface.service.tools.batch.worker.work import run_task

if TYPE_CHECKING:
    from denseface.service.tools.batch.summary.writer import SummaryWriter

__all__ = ["Batch", "Where", "run_batch", "write_summary"]

_FAILED, _UNREADABLE = 1, 2
"""Exit statuses."""
_SCRATCH = ".scratch"
_HALF_WRITTEN = re.compile(r"\.[0-9a-f]{16}\.tmp")
"""Names of files that were being written."""
_STATES = {"face": "face{s}", "no_face": "frame{s} without a face", "unreadable": "unreadable",
           "failed": "failed"}


@dataclass(frozen=True)
class Where:
    """Where faces are made.

    Attributes
    ----------
    workers : of a local cluster
    scheduler : address of one that is there; None for a local cluster
    tls : what it is connected to with
    """

    workers: int = 1
    scheduler: str | None = None
    tls: TlsFiles = field(default_factory=TlsFiles)

    def engine(self, folder: Path) -> Engine:
        """Start a cluster, or connect to it; raises as `local_engine` and `remote_engine`."""
        if self.scheduler is not None:
            return remote_engine(run_task, self.scheduler, self.tls)
        return local_engine(run_task, self.workers, private_folder(folder / _SCRATCH))


@dataclass(frozen=True)
class Batch:
    """What is to be done.

    Attributes
    ----------
    inputs : files and folders
    folder : of faces and summary
    limit_s : that a frame may take
    """

    inputs: Sequence[str]
    folder: Path
    plan: Plan
    limit_s: float = 120.0


def run_batch(
    batch: Batch, where: Where, engine: Callable[[Path], Engine] | None = None
) -> int:
    """Make a face of each frame, gather the summary, say what there is, and give the exit status.

    0 where each frame became a face; 1 where one has no face or failed; 2 where one could not be
    read. What is done stays, whatever ends it, and is not done again.

    Parameters
    ----------
    engine : gives another engine than Dask, of the batch's folder

    Raises
    ------
    MissingPackageError
        The extra `batch` is not installed.
    UsageError, FormatError, KeyFileError
        What is asked for is not possible, or not in this folder.
    StoreError, EngineError
        The batch cannot go on.
    """
    with explained("batch"):
        from denseface.service.tools.batch.summary.page import write_html
        from denseface.service.tools.batch.summary.progress import BatchProgress
        from denseface.service.tools.batch.summary.writer import SummaryWriter
    folder = batch.folder.absolute()
    if where.scheduler is not None:
        check_scheduler(where.scheduler, where.tls)
    names = claim_folder(folder, batch.plan, batch.inputs)
    given = {path: names[path] for path in map(absolute, batch.inputs) if path in names}
    tally: Counter[str] = Counter()
    losses = Losses(folder, batch.plan.every)
    with SummaryWriter(folder) as summary:  # nobody else writes there from here on
        _tidy(folder, [said.name for said in last_words(folder)])
        runner = (engine or where.engine)(folder)
        try:
            with BatchProgress() as progress, Counting(partial(_sources, given, folder)) as there:

                def gather(rows: list[Row], kept: list[Row]) -> None:
                    summary.add(*_counted(rows, summary), *_unknown(kept, summary))
                    for row in (*rows, *kept):
                        tally[row.state] += 1
                        progress.add(row)
                    if there.all is not None:
                        progress.total = schedule.expected(there.all)

                schedule = Schedule(
                    runner, Task(str(folder), batch.plan.to_json(), [], 0, 0, batch.limit_s),
                    _sources(given, folder), losses, gather, batch.plan.every)
                schedule.run()
        except BaseException:
            complain(f"denseface batch: stopped; what is done stays in {folder}, and the same "
                     "command goes on from there")
            raise
        finally:
            runner.close()
            _tidy(folder, losses.left_behind | {said.name for said in last_words(folder)})
    page = write_html(folder)
    say(f"{_told(tally)}; {folder}: faces in {FACES}/, summary.parquet", f"{page}: look at it")
    status = (_UNREADABLE if tally["unreadable"] else
              _FAILED if tally["no_face"] or tally["failed"] else 0)
    if status:
        without = tally.total() - tally["face"]
        complain(f"denseface batch: {without} of {tally.total()} gave no face; {page} says why")
    return status


def write_summary(folder: Path) -> int:
    """Write `summary.html` of a batch's folder, also of one that goes on; give the exit status.

    Raises
    ------
    MissingPackageError
        The extra `batch` is not installed.
    UsageError, CorruptFileError, StoreError
        The folder has no summary, or it cannot be read or written.
    """
    with explained("batch"):
        from denseface.service.tools.batch.summary.page import write_html
    say(f"{write_html(folder.absolute())}: look at it")
    return 0


def _sources(names: dict[str, str], folder: Path) -> Iterator[Part]:
    for path, name in names.items():
        yield from parts_of(path, name, str(folder))


def _counted(rows: Iterable[Row], summary: "SummaryWriter") -> Iterator[Row]:
    """Add the tries of earlier runs."""
    for row in rows:
        known = summary.known(row.source, row.frame)
        yield row if known is None else row.model_copy(
            update={"attempts": row.attempts + known.attempts})


def _unknown(rows: Iterable[Row], summary: "SummaryWriter") -> Iterator[Row]:
    """Leave out what the summary has: it lacks what was under way when a run was killed."""
    for row in rows:
        known = summary.known(row.source, row.frame)
        if known is None or (known.state, known.output) != (row.state, row.output):
            yield row


def _tidy(folder: Path, names: Iterable[str]) -> None:
    """Take away what workers left behind: half a file beside those of a frame, and their words."""
    for name in names:
        for kind in (FACES, RECORDS):
            with suppress(OSError):
                for path in (folder / kind / name).parent.iterdir():
                    if _HALF_WRITTEN.fullmatch(path.name):
                        path.unlink()
    for kind in (WORDS, _SCRATCH):
        shutil.rmtree(folder / kind, ignore_errors=True)


def _told(tally: Counter[str]) -> str:
    parts = [f"{tally[state]:,} {text.format(s='' if tally[state] == 1 else 's')}"
             for state, text in _STATES.items() if tally[state] or state == "face"]
    return ", ".join(parts)
