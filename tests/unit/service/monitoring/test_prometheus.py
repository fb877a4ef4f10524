"""The metrics and the health, from what the hub's loop shows."""

import pytest
from prometheus_client import generate_latest
from prometheus_client.parser import text_string_to_metric_families

from denseface.service.monitoring.figures import Latencies
from denseface.service.monitoring.health import Health, write_error
from denseface.service.monitoring.observer import Snapshot
from denseface.service.monitoring.prometheus import COUNTERS, Metrics
from denseface.service.protocol.messages import Status
from denseface.service.protocol.sensor_messages import SensorFigures
from denseface.service.protocol.status import SensorStatus
from denseface.service.settings import ServiceSettings

SETTINGS = ServiceSettings(address="ipc:///unused", reserve_mib=100)


def status(**changed):
    return Status(**{
        "epoch": "0f", "sequence": 3, "hub_version": "1.2", "sensors": ("s",),
        "workers": ("a", "b"), "pressed": 1, "queued": 2, "working": 3, "done": 4, "failed": 5,
        "dead": 6, "free_bytes": 2**30, "kept_bytes": 999, "log_lines_lost": 8,
        "restarts": {"hub": {"exited": 1, "hung": 2}}} | changed)


@pytest.fixture
def snapshot():
    latencies = Latencies()
    for seconds in (0.3, 0.3, 100.0):
        latencies.observe("press_to_published", seconds)
    return Snapshot(
        100.0, status(), (("accepted", "", 9), ("press_refused", "disk", 2), ("drops", "faces", 1),
                   ("refused", "unknown key", 7)), latencies.stages(), {"faces": 1, "preview": 0})


def samples(snapshot):
    text = generate_latest(Metrics(lambda: snapshot).registry).decode()
    return {(one.name, *sorted(one.labels.values())): one.value
            for family in text_string_to_metric_families(text) for one in family.samples
            if one.name.startswith("denseface_")}


def test_all_that_the_snapshot_holds_is_rendered(snapshot):
    found = samples(snapshot)
    assert found["denseface_accepted_total",] == 9
    assert found["denseface_presses_refused_total", "disk"] == 2
    assert found["denseface_refused_total", "unknown key"] == 7
    assert found["denseface_restarts_total", "exited", "hub"] == 1
    assert found["denseface_restarts_total", "hub", "hung"] == 2
    assert found["denseface_publication_drops_total", "faces"] == 1
    assert [found["denseface_in_flight", one] for one in ("pressed", "queued", "working")] == [
        1, 2, 3]
    assert [found["denseface_kept_captures", one] for one in ("done", "failed", "dead")] == [
        4, 5, 6]
    assert (found["denseface_sensors",], found["denseface_workers",]) == (1, 2)
    assert found["denseface_disk_free_bytes",] == 2**30
    assert found["denseface_kept_bytes",] == 999
    assert found["denseface_log_lines_lost_total",] == 8
    assert found["denseface_subscriptions", "faces"] == 1
    assert found["denseface_build", "1.2"] == 1
    bucket, stage = "denseface_latency_seconds_bucket", "press_to_published"
    assert [found[bucket, end, stage] for end in ("0.25", "0.5", "60.0", "+Inf")] == [0, 2, 2, 3]
    assert found["denseface_latency_seconds_count", "press_to_published"] == 3
    assert found["denseface_latency_seconds_sum", "press_to_published"] == pytest.approx(100.6)


SENSORS = (
    SensorStatus(name="a", state="streaming", figures=SensorFigures(
        frames=9, drops=2, skew_us=1500, stalls=3, reconnects=4, wrong_size=5)),
    SensorStatus(name="b", state="blocked", reason="busy"),
    SensorStatus(name="a", state="absent"))


def test_each_sensor_has_its_state_and_its_counts_once():
    found = samples(Snapshot(100.0, status(sensor_states=SENSORS), (), {}))
    assert [found[f"denseface_sensor_{name}_total", "a"] for name in (
        "frames", "drops", "stalls", "reconnects", "wrong_size")] == [9, 2, 3, 4, 5]
    assert found["denseface_sensor_skew_seconds", "a"] == 0.0015
    assert found["denseface_sensor_drops_total", "b"] == 0
    assert {state for (name, *labels), value in found.items() if name == "denseface_sensor_state"
            and value and (state := tuple(labels))} == {("a", "streaming"), ("b", "blocked")}


def test_what_never_happened_is_zero_so_that_alarms_can_be_set(snapshot):
    found = samples(snapshot)
    plain = [metric for metric, label, _ in COUNTERS.values() if label is None]
    assert len(plain) > 5
    for metric in plain:
        assert (f"denseface_{metric}_total",) in found


def test_nothing_is_known_before_the_first_status():
    assert samples(None) == {}


def judged(snapshot, *, now=100.5, why=None):
    return Health(lambda: snapshot, SETTINGS, lambda: why, lambda: now).report()


def test_all_is_well(snapshot):
    assert judged(snapshot) == (True, {
        "healthy": True, "missing": [], "version": "1.2", "sensors": 1, "workers": 2})


@pytest.mark.parametrize(("changed", "missing"), [
    ({"sensors": ()}, "sensor: none is alive"),
    ({"sensors": (), "sensor_states": SENSORS[1:2]}, "sensor: b is blocked: busy"),
    ({"workers": ()}, "worker: none is alive"),
    ({"free_bytes": 99 * 2**20}, "disk: 99 MiB free, 100 MiB are to stay free"),
    ({"free_bytes": None}, "disk: its free room is not known"),
])
def test_what_is_missing_has_a_name(snapshot, changed, missing):
    success, said = judged(Snapshot(100.0, status(**changed), (), {}))
    assert (success, said["healthy"], said["missing"]) == (False, False, [missing])


def test_a_hub_that_is_silent_a_store_and_everything(snapshot):
    assert judged(snapshot, now=130.0)[1]["missing"] == ["hub: has not said how it is for 30 s"]
    assert judged(snapshot, why="no")[1]["missing"] == ["store: no"]
    assert judged(None, why="no") == (False, {
        "healthy": False, "missing": ["hub: has not said how it is yet", "store: no"],
        "version": None, "sensors": 0, "workers": 0})


def test_the_probe_of_the_store_leaves_nothing_and_says_what_is_wrong(tmp_path):
    assert write_error(tmp_path) is None
    assert list(tmp_path.iterdir()) == []
    assert write_error(tmp_path / "missing") == f"{tmp_path / 'missing'}: No such file or directory"
