"""Counts, times and health, and how they are shown.

`health`, `prometheus` and `http_server` are loaded only where metrics are served.
"""

from denseface.service.monitoring.figures import Counters, Figures
from denseface.service.monitoring.observer import Observer
from denseface.service.monitoring.rejections import Rejections

__all__ = ["Counters", "Figures", "Observer", "Rejections"]
