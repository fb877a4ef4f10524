"""What is odd about a calibration that is possible."""

import math

from denseface.capture.calibration import Calibration

__all__ = ["doubts_of"]

_BASELINE_MM = (1.0, 300.0)
"""How far two cameras of one sensor are apart."""


def doubts_of(calibration: Calibration, registered: bool = False) -> tuple[str, ...]:
    """Say what is odd, in words for the user; of a registered frame nothing is.

    A pose that nobody gave is the identity, which is that of no sensor; a translation in metres
    looks like cameras in one place too.
    """
    if registered:
        return ()
    if "depth_to_color" not in calibration.model_fields_set:
        return ("the calibration has no pose between its cameras (depth_to_color): both are taken "
                "to stand in one place and to look the same way",)
    apart = math.hypot(*calibration.depth_to_color.translation_mm)
    if apart == 0 or _BASELINE_MM[0] <= apart <= _BASELINE_MM[1]:
        return ()
    return (f"the calibration has its cameras {apart:.4g} mm apart, expected {_BASELINE_MM[0]:g} "
            f"to {_BASELINE_MM[1]:g}"
            + (": metres in place of millimetres?" if apart < 1 else ""),)
