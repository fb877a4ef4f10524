"""The noise of a frame's depth, measured in the frame, and what follows from it for a fit."""

from denseface.recon.noise._measure import Noise, measure_noise
from denseface.recon.noise._risk import SHARPNESS, Risk, fit_of_cutoff, least_risk

__all__ = ["SHARPNESS", "Noise", "Risk", "fit_of_cutoff", "least_risk", "measure_noise"]
