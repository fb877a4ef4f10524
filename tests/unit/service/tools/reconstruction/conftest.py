"""Small frames in files, and a reconstruction that takes no time."""

from dataclasses import replace

import numpy as np
import pytest

from denseface.capture.npz import save_frame
from denseface.recon import NoFaceError
from denseface.recon.face import FaceCandidate
from denseface.service.export import render
from denseface.service.tools.reconstruction import many, single
from tests.unit.frames import frame
from tests.unit.service.faces import small_face

EMPTY_MM = 1500
"""Depth of a frame without a face."""
CANDIDATE = FaceCandidate(box=(40, 30, 50, 50), depth_mm=1500.0, width_mm=500.0,
                          verdict="not a face's size at its depth")


def write_frame(path, *, face: bool = True):
    """Write a frame of a wall: near is a face, far is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    depth = np.full((120, 160), 700 if face else EMPTY_MM, np.uint16)
    save_frame(frame(depth, np.full((120, 160, 3), 90, np.uint8)), path)
    return path


def made_up(given, settings):
    """Stand for `reconstruct`."""
    if given.depth[0, 0] == EMPTY_MM:
        error = NoFaceError("no face found: too wide")
        error.candidates = (CANDIDATE,)
        raise error
    face = small_face()
    return replace(face, report=face.report.model_copy(update={"warnings": ("it is made up",)}))


@pytest.fixture(autouse=True)
def reconstruct(monkeypatch):
    """Make faces without work."""
    for module in (many, single):
        monkeypatch.setattr(module, "reconstruct", made_up)
    monkeypatch.setattr(render, "render", lambda _: b"\x89PNG")


@pytest.fixture
def take(tmp_path):
    """A folder of three frames, the second without a face."""
    for number, has_face in enumerate((True, False, True)):
        write_frame(tmp_path / "take" / f"{number:06}.npz", face=has_face)
    return tmp_path / "take"
