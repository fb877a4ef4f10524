"""Lengths on a face in millimetres, each with the interval that holds the true one in 95 of 100."""

from denseface.recon.measurement._measure import Length, Measurements, Raw, measure, raw_lengths
from denseface.recon.measurement._warm import warm

__all__ = ["Length", "Measurements", "Raw", "measure", "raw_lengths", "warm"]
