"""Which calibration wins over what a source says of itself."""

from pathlib import Path
from typing import NamedTuple

from denseface.capture.calibration import Calibration

__all__ = ["ChosenCalibration", "choose_calibration"]


class ChosenCalibration(NamedTuple):
    """A calibration that wins over what the source says of itself, and where it came from."""

    calibration: Calibration
    origin: str


def choose_calibration(
    path: Path | None, argument: Calibration | str | Path | None
) -> ChosenCalibration | None:
    """Take the argument, else ``NAME.calibration.json`` beside the file, else none.

    Raises
    ------
    CalibrationError
        The chosen file cannot be read.
    """
    if isinstance(argument, Calibration):
        return ChosenCalibration(argument, "argument")
    if argument is not None:
        return ChosenCalibration(Calibration.from_file(argument), f"argument {argument}")
    if path is not None:
        beside = path.with_name(f"{path.stem}.calibration.json")
        if beside.exists():
            return ChosenCalibration(Calibration.from_file(beside), f"beside: {beside.name}")
    return None
