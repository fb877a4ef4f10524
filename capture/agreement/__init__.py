"""Whether a frame's depth and colour belong together, measured on the frame itself."""

from denseface.capture.agreement.check import Agreement, Verdict, measure_agreement

__all__ = ["Agreement", "Verdict", "measure_agreement"]
