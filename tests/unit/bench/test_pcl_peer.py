import numpy as np
import pytest

from bench import pcl_peer
from bench.pcl_peer import Pcl, PclMissingError


def test_says_what_is_missing(monkeypatch):
    monkeypatch.setattr(pcl_peer, "_headers", lambda: None)
    with pytest.raises(PclMissingError, match="libpcl-dev is not installed"):
        Pcl(install=False)


def test_upsamples_a_plane():
    try:
        pcl = Pcl(install=False)
    except PclMissingError as missing:
        pytest.skip(str(missing))
    steps = np.arange(20.0)
    x, y = (axis.ravel() for axis in np.meshgrid(steps, steps))
    dense, took_ms = pcl.run(np.column_stack([x, y, 700 + 0.1 * x]), 1.0, 4.0)
    assert took_ms > 0
    assert len(dense) > 5 * len(x)
    assert np.abs(dense[:, 2] - 700 - 0.1 * dense[:, 0]).max() < 0.01
