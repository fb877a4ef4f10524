"""A program that uses the public face, for the type checker alone: script/lint checks it.

What is to be refused says so by `type: ignore`, which the checker refuses where nothing is wrong.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from denseface import (
    AsyncClient,
    Calibration,
    CameraModel,
    Client,
    Consent,
    DensefaceError,
    Face,
    Preset,
    PublishedFace,
    PublishedFailure,
    RgbdFrame,
    Settings,
    Source,
    __version__,
    load_face,
    load_frame,
    open_source,
    reconstruct,
    save_face,
    save_frame,
)

VERSION: str = __version__


def of_a_recording(path: Path) -> Iterator[Face]:
    """Reconstruct each frame of a file."""
    settings: Settings = Settings.of(Preset.PAPER, smoothing=2, ratio=5.0, neighbors="exact")
    source: Source = open_source(path, calibration=path.with_suffix(".json"), rotation=90)
    with source:
        for frame in source:
            save_frame(frame, path.with_suffix(".npz"))
            yield reconstruct(frame, settings)


def of_arrays(depth: NDArray[np.uint16], color: NDArray[np.uint8]) -> Face:
    """Reconstruct arrays of one's own."""
    camera = CameraModel(width=640, height=480, fx=575.8, fy=575.8, cx=319.5, cy=239.5)
    frame = RgbdFrame(depth, color, 0, 0, Calibration(depth=camera, color=camera), registered=True)
    return reconstruct(frame)


def lengths(face: Face) -> tuple[int, float, NDArray[np.float32], tuple[str, ...]]:
    """Take a face apart."""
    dense, report = face.dense, face.report
    return (len(face.initial), report.timings_ms["total"], dense.points + dense.normals,
            report.warnings)


def press(save: Path) -> str:
    """Press, get, follow."""
    with Client("tcp://hub:5700", key=save, hub_key="hub.public") as client:
        name: str = client.press(gate="wait", frames=4)
        save_face(client.get(name, timeout=60), save)
        for outcome in client.published(last=3):
            if isinstance(outcome, PublishedFace):
                save_face(outcome.face, save)
            else:
                failure: PublishedFailure = outcome
                return failure.error.error
        return client.status().state


async def follow(client: AsyncClient, consent: Consent) -> Face:
    """The same under asyncio."""
    try:
        return await client.get(await client.press(consent=consent))
    except DensefaceError as error:
        raise SystemExit(str(error)) from error


def refused(face: Face, frame: RgbdFrame) -> None:
    """What a checker has to find."""
    Settings.of("best", smooting=3)  # type: ignore[call-arg]
    Settings.of("best", ratio="ten")  # type: ignore[arg-type]
    save_face("face.ply", face)  # type: ignore[arg-type]
    save_frame("frame.npz", frame)  # type: ignore[arg-type]
    reconstruct(load_face("face.npz"))  # type: ignore[arg-type]
    save_face(load_frame("frame.npz"), "face.ply")  # type: ignore[arg-type]
    frame.depht  # type: ignore[attr-defined]  # noqa: B018
