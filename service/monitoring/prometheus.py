"""The hub's figures as Prometheus metrics."""

from collections.abc import Callable, Iterator, Mapping
from itertools import accumulate
from typing import get_args

from prometheus_client import CollectorRegistry, ProcessCollector, core
from prometheus_client.registry import Collector

from denseface.service.monitoring.figures import BUCKETS_S, Histogram
from denseface.service.monitoring.observer import Snapshot
from denseface.service.protocol.sensor_messages import LiveStateName
from denseface.service.protocol.status import SensorStatus

__all__ = ["COUNTERS", "Metrics"]

COUNTERS: dict[str, tuple[str, str | None, str]] = {
    "accepted": ("accepted", None, "Frames that are safe on the disk."),
    "press_refused": ("presses_refused", "reason", "Presses that led to no capture."),
    "done": ("done", None, "Faces published."),
    "failed": ("failed", None, "Captures published as without a face."),
    "dead": ("dead", None, "Captures given up after repeated attempts."),
    "redelivered": ("redelivered", None, "Jobs given out again."),
    "overdue": ("overdue", None, "Jobs taken back from workers that held them for too long."),
    "removed": ("removed", "by", "Captures removed."),
    "refused": ("refused", "reason", "Connections and messages refused."),
    "drops": ("publication_drops", "topic",
              "Publications at which a subscriber's queue was found full."),
    "fetched": ("fetched", None, "Outcomes that subscribers requested."),
    "previews": ("previews", None, "Previews published."),
    "hints": ("hints", None, "Hints published."),
}
"""Name in `Counters` -> name of the metric, its label, its help text."""

_SENSOR_COUNTERS = {
    "frames": "Pairs of depth and colour.",
    "drops": "Images that were lost or had no partner.",
    "stalls": "Times that the stream fell silent.",
    "reconnects": "Times that the sensor was opened again.",
    "wrong_size": "Images of another size than the mode's.",
}
"""Field of `SensorFigures` -> help text of its metric."""

_PREFIX = "denseface_"


class Metrics(Collector):
    """Shows the last snapshot, which `latest` gives, None before there is one; for any thread."""

    def __init__(self, latest: Callable[[], Snapshot | None]) -> None:
        self._latest = latest
        self.registry = CollectorRegistry(auto_describe=False)
        """These metrics, and those of the process."""
        self.registry.register(self)
        ProcessCollector(registry=self.registry)

    def collect(self) -> Iterator[core.Metric]:
        """Give the families; none before the hub's first status."""
        snapshot = self._latest()
        if snapshot is not None:
            yield from _counters(snapshot)
            yield _restarts(snapshot)
            yield from _gauges(snapshot)
            yield from _sensors(snapshot)
            yield _latencies(snapshot.stages)


def _counters(snapshot: Snapshot) -> Iterator[core.Metric]:
    for name, (metric, label, text) in COUNTERS.items():
        found = {one: count for known, one, count in snapshot.counts if known == name}
        family = core.CounterMetricFamily(_PREFIX + metric, text, labels=[label] if label else [])
        if label is None:
            family.add_metric([], sum(found.values()))
        for one, count in found.items() if label else ():
            family.add_metric([one], count)
        yield family
    yield core.CounterMetricFamily(
        _PREFIX + "log_lines_lost", "Lines of the hub's log that could not be written.",
        value=snapshot.status.log_lines_lost)


def _restarts(snapshot: Snapshot) -> core.Metric:
    family = core.CounterMetricFamily(
        _PREFIX + "restarts", "Processes that were started again.", labels=["process", "reason"])
    for process, counts in snapshot.status.restarts.items():
        family.add_metric([process, "exited"], counts.exited)
        family.add_metric([process, "hung"], counts.hung)
    return family


def _gauges(snapshot: Snapshot) -> Iterator[core.Metric]:
    status = snapshot.status
    yield _gauge_family("in_flight", "Captures without an outcome.", "state", {
        "pressed": status.pressed, "queued": status.queued, "working": status.working})
    yield _gauge_family("kept_captures", "Captures kept in the data folder.", "state", {
        "done": status.done, "failed": status.failed, "dead": status.dead})
    yield _gauge_family("subscriptions", "Subscriptions.", "topic", snapshot.subscriptions)
    yield _gauge("sensors", "Sensors alive.", len(status.sensors))
    yield _gauge("workers", "Workers alive.", len(status.workers))
    if status.free_bytes is not None:
        yield _gauge("disk_free_bytes", "Room left on the data folder's disk.", status.free_bytes)
    if status.kept_bytes is not None:
        yield _gauge("kept_bytes", "Size of the files kept.", status.kept_bytes)
    yield _gauge_family("build", "Always 1.", "version", {status.hub_version: 1})


def _sensors(snapshot: Snapshot) -> Iterator[core.Metric]:
    """Give what each sensor says of itself; of two with one name the first, which is asked."""
    by_name: dict[str, SensorStatus] = {}
    for one in snapshot.status.sensor_states:
        by_name.setdefault(one.name, one)
    state = core.GaugeMetricFamily(
        _PREFIX + "sensor_state", "1 for the state of a sensor, else 0.",
        labels=["sensor", "state"])
    for name, one in by_name.items():
        for known in get_args(LiveStateName):
            state.add_metric([name, known], one.state == known)
    yield state
    for field, text in _SENSOR_COUNTERS.items():
        family = core.CounterMetricFamily(f"{_PREFIX}sensor_{field}", text, labels=["sensor"])
        for name, one in by_name.items():
            family.add_metric([name], getattr(one.figures, field))
        yield family
    yield _gauge_family(
        "sensor_skew_seconds", "Between depth and colour of the newest pair.", "sensor",
        {name: one.figures.skew_us / 1e6 for name, one in by_name.items()})


def _gauge(name: str, text: str, value: int) -> core.Metric:
    return core.GaugeMetricFamily(_PREFIX + name, text, value=value)


def _gauge_family(name: str, text: str, label: str, values: Mapping[str, float]) -> core.Metric:
    family = core.GaugeMetricFamily(_PREFIX + name, text, labels=[label])
    for one, value in values.items():
        family.add_metric([one], value)
    return family


def _latencies(stages: dict[str, Histogram]) -> core.Metric:
    family = core.HistogramMetricFamily(
        _PREFIX + "latency_seconds", "How long each stage took.", labels=["stage"])
    for stage, one in stages.items():
        ends = [*map(str, BUCKETS_S), "+Inf"]
        family.add_metric([stage], list(zip(ends, accumulate(one.counts), strict=True)),
                          sum_value=one.total_s)
    return family
