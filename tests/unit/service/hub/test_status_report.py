"""A change is told at once, and several together; a heartbeat tells the rest."""

import math

import pytest

from denseface.service.errors import StoreError
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Publish
from denseface.service.protocol.roles import Role
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from tests.unit.service.hub.bench import OTHER, SENSOR, SETTINGS, WORKER


class Said:
    """Statuses that a hub has published."""

    def __init__(self, bench):
        self.bench = bench

    def _of(self, outputs):
        return [one.packet.message for one in outputs
                if isinstance(one, Publish) and one.topic is Topic.STATUS]

    def by(self, peer, message):
        return self._of(self.bench.hub.receive(self.bench.now, peer, Packet(message)))

    def later(self, seconds=1.0):
        self.bench.now += seconds
        return self._of(self.bench.hub.tick(self.bench.now))


def state(name, state, reason=""):
    return messages.SensorState(name=name, state=state, reason=reason)


@pytest.fixture
def said(bench):
    said = Said(bench)
    assert len(said.later()) == 1
    assert bench.hub.due() == math.inf
    bench.now += 0.5
    return said


def test_a_sensor_that_comes_changes_or_goes_is_told_at_once(bench, said):
    (first,) = said.by(SENSOR, state("s", "streaming"))
    assert first.has_frames
    bench.now += 0.2
    assert said.by(SENSOR, state("s", "streaming")) == []
    (gone,) = said.by(SENSOR, state("s", "absent", "it was unplugged"))
    assert (gone.has_frames, gone.sensor_states[0].reason) == (False, "it was unplugged")
    bench.now += 0.2
    bench.hub.connection_ended(SENSOR, local=True)
    (none,) = said._of(bench.hub.act(bench.now))
    assert none.sensor_states == ()


def test_changes_that_come_close_are_told_together_and_soon(bench, said):
    assert len(said.by(SENSOR, state("s", "opening"))) == 1
    assert said.by(OTHER, state("o", "opening")) == []
    assert said.by(SENSOR, state("s", "streaming")) == []
    assert bench.hub.due() == pytest.approx(bench.now + 0.1)
    assert said._of(bench.hub.act(bench.now)) == []
    bench.now = bench.hub.due()
    (both,) = said._of(bench.hub.act(bench.now))
    assert [one.state for one in both.sensor_states] == ["streaming", "opening"]
    assert bench.hub.due() == math.inf


def test_heartbeats_go_on_and_tell_the_figures(bench, said):
    for number in range(4):  # changes that never end do not keep them back
        bench.now += 0.2
        assert len(said.by(SENSOR, state("s", "streaming", str(number)))) == 1
        assert len(said.later(SETTINGS.heartbeat_s / 2 - 0.2)) == (number + 1) % 2


def test_a_worker_that_comes_or_dies_is_told_at_once_and_its_job_goes_to_another(bench, said):
    bench.accepted("a")
    bench.now += 0.2
    (first,) = said.by(WORKER, messages.WorkerReady(name="w", credit=0))
    assert first.workers == ("w",)
    bench.worker(OTHER)
    bench.now += 0.2
    bench.hub.connection_ended(WORKER, local=True)
    outputs = bench.hub.tick(bench.now)
    assert [one.packet.message.attempt for one in outputs
            if isinstance(one.packet.message, messages.Job)] == [2]
    assert said._of(outputs)[0].workers == ("other",)


def test_a_worker_elsewhere_may_come_back_with_its_face(bench, said):
    bench.accepted("a")
    bench.worker(WORKER)
    bench.now += 0.2
    bench.hub.connection_ended(WORKER, local=False)
    (status,) = said._of(bench.hub.act(bench.now))
    assert (status.workers, status.working) == ((), 1)
    bench.worker(OTHER, 1)
    bench.result("a", OTHER)
    assert bench.published[-1].kind == "face_done"


def test_a_worker_elsewhere_that_comes_back_by_the_same_id_is_there_again(bench, said):
    """As a DEALER with an id of its own does: its credit begins anew, and that is no replay."""
    bench.worker(WORKER, 3)
    bench.hub.connection_ended(WORKER, local=False)
    bench.now += 0.2
    assert said._of(bench.hub.act(bench.now))[0].workers == ()
    bench.now += 0.2
    (back,) = said.by(WORKER, messages.WorkerReady(name="back", credit=0))
    assert back.workers == ("back",)
    assert bench.hub._rejections.counts() == {}
    bench.accepted("a")
    bench.result("a", WORKER)
    assert bench.published[-1].kind == "face_done"


def test_a_worker_elsewhere_that_does_not_come_back_loses_its_job(bench, said):
    bench.accepted("a")
    bench.worker(WORKER)
    bench.hub.connection_ended(WORKER, local=False)
    bench.now += SETTINGS.silence_s
    bench.worker(OTHER)
    sent = bench.wait(0.1)
    assert [message.attempt for _, message in sent if message.kind == "job"] == [2]


def test_what_refuses_every_press_is_told_when_it_begins_and_when_it_ends(
        bench, said, monkeypatch):
    def fails():
        raise StoreError("the disk fails")

    monkeypatch.setattr(bench.store, "free_bytes", fails)
    (full,) = said.later(0.15)
    assert (full.obstacle, full.ready) == ("disk", False)
    assert said.later(0.15) == []
    monkeypatch.undo()
    (room,) = said.later(0.15)
    assert room.obstacle == ""


def test_a_new_subscriber_is_told_at_once(bench, said):
    bench.hub.status_subscribers(1)
    assert len(said._of(bench.hub.act(bench.now))) == 1
    bench.hub.status_subscribers(1)
    assert bench.hub.act(bench.now + 0.2) == []
    bench.hub.status_subscribers(0)
    assert bench.hub.act(bench.now + 0.2) == []


def test_it_says_how_long_captures_are_kept(bench):
    assert bench.hub._status.make().retention_s == SETTINGS.retention


def compiles(done, name="w"):
    return messages.Heartbeat(compiling=messages.Compiling(name=name, done=done, total=63))


def test_a_worker_that_compiles_is_told_with_how_far_it_is_until_it_is_ready(bench, said):
    assert bench.say(WORKER, compiles(11)) == bench.say(WORKER, compiles(12)) == []
    (status,) = said.later()
    assert (status.workers, status.kernels) == ((), "a worker compiles its kernels, 12 of 63")
    assert not status.ready
    bench.say(WORKER, messages.WorkerReady(name="w", credit=0))
    (status,) = said.later()
    assert (status.workers, status.kernels) == (("w",), "")


def test_one_that_compiles_and_falls_silent_or_says_so_no_more_is_forgotten(bench, said):
    bench.say(OTHER, compiles(0))
    bench.say(WORKER, compiles(12))
    assert [sent.kind for _, sent in bench.say(WORKER, messages.Heartbeat())] == ["announce"]
    assert [len(one.compiling) for one in said.later()] == [1]
    assert not said.later(100)[-1].compiling


def test_a_key_of_a_sensor_is_no_worker_that_compiles(bench, said):
    roles = frozenset({Role.SENSOR})
    bench.say(SENSOR, compiles(12), key="k", roles=roles)
    for number in range(70):
        bench.say(b"%d" % number, compiles(number), key="k", roles=frozenset({Role.WORKER}))
    (status,) = said.later()
    assert len(status.compiling) == 64, "of one key, as of workers"
    assert "of 63" in status.kernels
