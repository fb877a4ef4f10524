"""How much later the colour stream of a recording began than its depth stream.

OpenNI2's recorder lets the stamps of each stream start at 0. Where colour began later, a pair by
stamps is depth and colour of different times. The records lie in the file in the order in which
the frames came, which shows the lag, to within one frame.
"""

import math
from collections.abc import Sequence

import numpy as np

from denseface.capture.oni.records import DEPTH_NODE

__all__ = ["color_lag_us"]


def color_lag_us(kinds: Sequence[int], stamps_us: Sequence[int]) -> int:
    """Estimate what is to be added to the stamps of colour frames.

    A colour frame's time lies between the stamps of the depth frames that were recorded before and
    after it, give or take the half period by which the two cameras of a sensor may differ. Only
    where this contradicts the stamps of most colour frames is there a lag. The order allows for one
    period more or less: of the two lags by which frames make pairs, the one is taken by which the
    recording ends with a pair.

    Parameters
    ----------
    kinds, stamps_us : kind of node and stamp of each frame, in the order of the file; nothing but
        depth and colour

    Returns
    -------
    microseconds; negative where depth began later, 0 where the stamps may be right
    """
    stamps, is_depth = np.asarray(stamps_us, np.int64), np.asarray(kinds) == DEPTH_NODE
    depth, color = stamps[is_depth], stamps[~is_depth]
    steps = [float(np.median(np.diff(each))) for each in (depth, color) if len(each) > 1]
    if not steps or not len(depth) or not len(color):
        return 0
    half_period = max(steps) / 2
    depths_before = np.cumsum(is_depth)[~is_depth]  # of each colour frame
    between = (depths_before > 0) & (depths_before < len(depth))
    if between.any():
        following, color = depths_before[between], color[between]
        least = float(np.median(depth[following - 1] - color))
        most = float(np.median(depth[following] - color))
    else:
        # One stream's frames come after the other's, as also where both came in a burst: then not
        # all of them contradict their stamps.
        colors_before = np.cumsum(~is_depth)[is_depth]  # of each depth frame
        after, before = depths_before > 0, colors_before > 0
        least, most = -math.inf, math.inf
        if after.any():
            least = float(np.min(depth[depths_before[after] - 1] - color[after]))
        if before.any():
            most = float(np.max(depth[before] - color[colors_before[before] - 1]))
    if least > half_period:
        return round(most if is_depth[-1] and most < math.inf else least)
    if most < -half_period:
        return round(most if is_depth[-1] or least == -math.inf else least)
    return 0
