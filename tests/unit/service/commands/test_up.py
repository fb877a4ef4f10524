"""What `up` passes on to each sensor's process."""

from pathlib import Path

import pytest

from denseface.service.commands.up import _captures


@pytest.mark.parametrize(("rotations", "given"), [
    ([], ([], [])),
    ([90], (["--rotate=90"], ["--rotate=90"])),
    ([0, 270], (["--rotate=0"], ["--rotate=270"]))])
def test_a_rotation_is_for_all_sensors_or_one_for_each(rotations, given):
    first, second = _captures(["a", "b"], [Path("c"), Path("d")], rotations)
    assert first == ["--source=a", "--calibration=c", *given[0]]
    assert second == ["--source=b", "--calibration=d", *given[1]]
