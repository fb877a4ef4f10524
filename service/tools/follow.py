"""Outcomes as they are published: saved, and told in one line each."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from denseface.service.client import Published, PublishedFailure
from denseface.service.export import FaceFiles

__all__ = ["follow"]


def follow(outcomes: Iterable[Published], folder: Path | None) -> Iterator[str]:
    """Save each face as `ID.ply` with its report, `ID.json`; give a line for each outcome.

    Parameters
    ----------
    folder : where to save; None saves nothing

    Raises
    ------
    StoreError
        Where a file cannot be written.
    """
    for outcome in outcomes:
        name = f"{outcome.sequence} {outcome.capture_id}"
        if isinstance(outcome, PublishedFailure):
            yield f"{name} failed: {outcome.error}"
            continue
        if folder:
            path = folder / f"{outcome.capture_id}.ply"
            FaceFiles(path, path.with_suffix(".json")).write(outcome.face)
        yield f"{name} {len(outcome.face.dense)} points"
