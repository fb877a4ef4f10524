"""Outcomes as they are published: saved, and told in one line each."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from denseface.service.client import Published, PublishedFailure
from denseface.service.export import FaceFiles

__all__ = ["follow"]


def follow(outcomes: Iterable[Published], folder: Path | None, mode: int) -> Iterator[str]:
    """Give a line for each outcome; save each face as `ID.ply` with its report, `ID.json`.

    The files have this `mode`; nothing is saved where `folder` is None. Raises as
    `FaceFiles.write`.
    """
    for outcome in outcomes:
        name = f"{outcome.sequence} {outcome.capture_id}"
        if isinstance(outcome, PublishedFailure):
            yield f"{name} failed: {outcome.error}"
            continue
        if folder:
            path = folder / f"{outcome.capture_id}.ply"
            FaceFiles(path, path.with_suffix(".json"), mode=mode).write(outcome.face)
        yield f"{name} {len(outcome.face.dense)} points"
