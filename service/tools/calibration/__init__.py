"""Calibration of a sensor by a board that both of its cameras see."""

from denseface.service.tools.calibration._boards import Board, Charuco, Checkerboard
from denseface.service.tools.calibration._report import CalibrationReport, picture
from denseface.service.tools.calibration._solve import Solution, solve
from denseface.service.tools.calibration._views import BoardView, look_for_board, paired_files

__all__ = ["Board", "BoardView", "CalibrationReport", "Charuco", "Checkerboard", "Solution",
           "look_for_board", "paired_files", "picture", "solve"]
