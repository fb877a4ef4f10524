"""What was read along a ray, past the outline of a face."""

import numpy as np

from denseface.capture.frame import DepthMeaning, DepthRounding
from denseface.recon.pipeline import _depths_at
from tests.unit.frames import frame


def test_what_is_past_the_sensors_largest_number_is_no_reading():
    depth = np.full((120, 160), 7000, np.uint16)
    depth[:, :40], depth[:, 40:80], depth[:, 120:] = 0, 9000, 12000
    meant = DepthMeaning(unit_um=100, rounding=DepthRounding.CUT, max_mm=1000)
    shown = frame(depth, np.zeros((120, 160, 3), np.uint8), depth_meaning=meant)
    columns = np.array([20, 60, 100, 140, 500])
    points = np.stack([(columns - 79.5) * 4, np.zeros(5), np.full(5, 600.0)], axis=1)
    found = _depths_at(shown, points.astype(np.float32))
    np.testing.assert_allclose(found, [0, 900.05, 700.05, 0, 0], atol=1e-3)
