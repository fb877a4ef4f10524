"""What an operator's page asks: the last captures, and that a sensor begins anew."""

from datetime import UTC, datetime

from denseface.recon.face import Consent
from denseface.service.protocol import messages
from denseface.service.protocol.sensor_messages import SensorState
from tests.unit.service.hub.bench import CLIENT, OTHER, SENSOR, WORKER, kinds

OPERATOR = b"operator"
CONSENT = Consent(text_version="1", language="en", at=datetime(2026, 1, 31, tzinfo=UTC))


def listed(bench, **more):
    ((_, answer),) = bench.say(OPERATOR, messages.ListCaptures(request=1, **more))
    return answer.captures


def test_the_last_captures_are_listed_with_the_state_that_they_have_now(bench):
    assert listed(bench) == ()
    bench.accepted("done", "failed", "working")
    bench.worker(WORKER, 1)
    bench.result("done")
    bench.say(CLIENT, messages.Press(request=9, capture_id="waits", consent=CONSENT))
    bench.frame("waits")
    bench.worker(WORKER, 2)
    bench.fail_job(capture_id="failed", final=True)
    bench.worker(WORKER, 3)
    waits, working, failed, done = listed(bench)
    assert [one.capture_id for one in (waits, working, failed, done)] == [
        "waits", "working", "failed", "done"]
    assert [one.state for one in (waits, working, failed, done)] == [
        "accepted", "working", "failed", "done"]
    assert (waits.consent, waits.finished_at, working.consent) == (CONSENT, None, None)
    assert (failed.error, failed.message, failed.sequence) == ("Error", "why", 2)
    assert (done.error, done.sequence, done.attempts) == (None, 1, 1)
    assert done.accepted_at <= done.finished_at
    assert [one.capture_id for one in listed(bench, last=2)] == ["waits", "working"]


def test_what_was_removed_is_not_listed(bench):
    bench.accepted("a", "b")
    bench.say(OPERATOR, messages.Purge(request=2, capture_id="b"))
    assert [one.capture_id for one in listed(bench)] == ["a"]


def test_a_sensor_is_told_to_begin_anew_by_its_name(bench):
    bench.sensor()
    bench.say(OTHER, SensorState(name="other", state="stalled"))
    restart = messages.RestartSensor(request=3, sensor="other")
    assert bench.say(OPERATOR, restart) == [
        (OTHER, messages.Restart()),
        (OPERATOR, messages.SensorRestarting(request=3, sensor="other"))]
    assert kinds(bench.say(OPERATOR, messages.RestartSensor(request=4, sensor="s"))) == [
        (SENSOR, "restart"), (OPERATOR, "sensor_restarting")]
    ((_, answer),) = bench.say(OPERATOR, messages.RestartSensor(request=5, sensor="attic"))
    assert answer.message == "no sensor attic is connected; there: other, s"
