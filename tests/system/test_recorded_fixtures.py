"""The committed recordings open, and are what the folder's README says."""

from pathlib import Path

import numpy as np
import pytest

from denseface.capture.frame import DepthMeaning, DepthRounding
from denseface.service.tools.bench import sample_frame
from tests.virtual_sensor.fixtures import FIXTURES, FOLDER
from tests.virtual_sensor.process import play

NAMES = list(FIXTURES)


def test_every_fixture_is_there_and_explained():
    assert sorted(path.stem for path in FOLDER.glob("*.oni")) == sorted(NAMES)
    text = (FOLDER / "README.md").read_text()
    assert all(f"`{name}`" in text for name in NAMES)


def test_the_folder_stays_small():
    sizes = {path.name: path.stat().st_size for path in FOLDER.iterdir()}
    assert sum(sizes.values()) <= 12_000_000
    assert max(sizes.values()) < 2_400_000


@pytest.mark.parametrize("name", NAMES)
def test_a_fixture_plays(name):
    frames, origin = play(FOLDER / f"{name}.oni")
    assert len(frames) == FIXTURES[name].frames
    calibration = FOLDER / f"{name}.calibration.json"
    if calibration.exists():
        assert origin == f"beside: {calibration.name}"
    else:
        assert origin.startswith("recording: ZPD 120")
    truth: Path = FOLDER / f"{name}.truth.npz"
    assert truth.exists() == bool(FIXTURES[name].scene.people)
    if name == "wall_close":  # what `denseface bench` measures is this
        sample = sample_frame()
        assert (sample.depth == frames[0].depth).all()
        assert np.abs(sample.rgb.astype(int) - frames[0].rgb).mean() < 2
        assert (sample.calibration, sample.depth_meaning) == (
            frames[0].calibration, frames[0].depth_meaning)
    for frame in frames:
        assert frame.depth.shape == (480, 640)
        assert np.count_nonzero(frame.depth) > 10_000
        assert frame.rgb.std() > 10
        assert frame.depth_meaning == DepthMeaning(1000, DepthRounding.CUT, 10_000)
