"""Outcomes and hints as they are published: told in one line each, faces saved."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from denseface.files import check_place, make_folder
from denseface.service.client import Published, PublishedFace, PublishedFailure, PublishedHint
from denseface.service.errors import StoreError, reason_of
from denseface.service.export import save_face, save_report
from denseface.service.runtime.files import check_outside_hub

__all__ = ["FaceFolder", "Told", "changes", "follow"]


class Told(NamedTuple):
    """A line about an outcome."""

    line: str
    lost: bool = False
    """Whether it is about a face that could not be saved."""


class FaceFolder:
    """Where faces are saved, as `ID.ply` and so on, each with its report, `ID.json`.

    Parameters
    ----------
    folder : is made where it is missing
    endings : of `FORMATS`, one for each file of a face
    mode : of the files; who may read them may enter a folder that is made

    Raises
    ------
    UsageError
        The folder is a hub's data folder, or in one.
    StoreError
        It cannot be made, or nothing can be written into it.
    """

    def __init__(self, folder: Path, endings: Sequence[str], mode: int) -> None:
        self._folder, self._endings, self._mode = folder, endings, mode
        check_outside_hub(folder / "ID")
        try:
            make_folder(folder.absolute(), mode)
            check_place(folder / "ID")
        except OSError as error:
            raise StoreError(f"{folder}: {reason_of(error)}") from error

    def save(self, outcome: PublishedFace) -> None:
        """Write a face's files; OSError, which names the file, where one cannot be written."""
        for ending in self._endings:
            save_face(outcome.face, self._folder / f"{outcome.capture_id}{ending}", mode=self._mode)
        save_report(outcome.face, self._folder / f"{outcome.capture_id}.json", mode=self._mode)


def follow(outcomes: Iterable[Published], folder: FaceFolder | None) -> Iterator[Told]:
    """Tell each outcome in a line; save each face, unless `folder` is None.

    A face that cannot be saved is told, and the next one is tried again: there may be room by then.
    """
    for outcome in outcomes:
        name = f"{outcome.sequence} {outcome.capture_id}"
        if isinstance(outcome, PublishedFailure):
            yield Told(f"{name} failed: {outcome.error}")
            continue
        if folder:
            try:
                folder.save(outcome)
            except OSError as error:
                yield Told(f"{name} not saved: {error.filename}: {reason_of(error)}; the hub has "
                           f"the face until its retention ends: denseface get "
                           f"{outcome.capture_id} --save FILE", lost=True)
                continue
        yield Told(f"{name} {len(outcome.face.dense)} points")


def changes(hints: Iterable[PublishedHint]) -> Iterator[str]:
    """Give a line for each hint that says something else than the last one of its sensor."""
    last: dict[str, tuple[str, ...]] = {}
    for hint in hints:
        if last.get(hint.sensor) != hint.codes:
            last[hint.sensor] = hint.codes
            codes = f" ({', '.join(hint.codes)})" if hint.codes else ""
            yield f"{hint.sensor}: {hint.text or 'good'}{codes}"
