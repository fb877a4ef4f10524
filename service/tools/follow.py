"""Outcomes and hints as they are published: told in one line each, faces saved."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from denseface.service.client import Published, PublishedFailure, PublishedHint
from denseface.service.export import FaceFiles

__all__ = ["changes", "follow"]


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


def changes(hints: Iterable[PublishedHint]) -> Iterator[str]:
    """Give a line for each hint that says something else than the last one of its sensor."""
    last: dict[str, tuple[str, ...]] = {}
    for hint in hints:
        if last.get(hint.sensor) != hint.codes:
            last[hint.sensor] = hint.codes
            codes = f" ({', '.join(hint.codes)})" if hint.codes else ""
            yield f"{hint.sensor}: {hint.text or 'good'}{codes}"
