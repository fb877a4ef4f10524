"""Looks for what keeps a sensor from working, and says how each thing is put right."""

from denseface.service.tools.doctor.run import run

__all__ = ["run"]
