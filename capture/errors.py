"""What can go wrong between a sensor and a frame.

Each error is also the builtin kind that a caller would expect to catch.
"""

from denseface.errors import DensefaceError

__all__ = ["CalibrationError", "CaptureError", "DriverError", "FrameError", "MismatchedFrameError",
           "SensorError", "SensorTimeoutError", "UnreadableSourceError", "WrongSizeError"]


class CaptureError(DensefaceError):
    """Base of every error raised by `capture`."""


class CalibrationError(CaptureError, ValueError):
    """A calibration is malformed or physically impossible."""


class FrameError(CaptureError, ValueError):
    """A frame's arrays do not have the shape, dtype or size that its calibration states."""


class MismatchedFrameError(FrameError):
    """Depth and colour show different things, or another geometry than any that is known."""


class UnreadableSourceError(CaptureError, OSError):
    """A recording or frame file is missing, truncated or not of the format its name says."""


class SensorError(CaptureError, RuntimeError):
    """The driver or the device refused: no device, no stream, or it went away."""


class DriverError(SensorError):
    """A sensor's library or its binding is missing or unusable: another try would end the same."""


class SensorTimeoutError(SensorError, TimeoutError):
    """The sensor sent nothing for longer than allowed."""


class WrongSizeError(SensorError):
    """A frame is not of the size that its stream's mode says: the next one may be."""
