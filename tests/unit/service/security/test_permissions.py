"""Who may say what."""

import sys

import pytest
import structlog

from denseface.recon.settings import Settings
from denseface.service.log.events import configure
from denseface.service.log.output import process_log
from denseface.service.monitoring import Counters, Rejections
from denseface.service.protocol import messages
from denseface.service.protocol.payload import FrameHeader
from denseface.service.protocol.roles import Role
from denseface.service.protocol.topics import Topic
from denseface.service.security.permissions import (
    ALL_ROLES,
    ROLES_BY_KIND,
    ROLES_BY_TOPIC,
    missing_role,
)
from tests.unit.service.faces import small_frame
from tests.waiting import LIMIT_S

FRAME, _ = FrameHeader.of(small_frame())
SAID = [
    messages.Press(request=1, capture_id="a"),
    messages.Withdraw(request=1, capture_id="a"),
    messages.GetFace(request=1, capture_id="a"),
    messages.GetFrame(request=1, capture_id="a"),
    messages.GetNext(request=1, after=0),
    messages.GetStatus(request=1),
    messages.FindStart(request=1, last=1),
    messages.ListDead(request=1, after=0),
    messages.ListCaptures(request=1),
    messages.RestartSensor(request=1, sensor="s"),
    messages.RetryDead(request=1, capture_id="a"),
    messages.DropDead(request=1, capture_id="a"),
    messages.Purge(request=1, everything=True),
    messages.SensorReady(name="s", source="x"),
    messages.Frame(capture_id="a", frame=FRAME),
    messages.WorkerReady(name="w", credit=0),
    messages.JobFailed(capture_id="a", settings_hash="0", frame_sha256="0" * 64,
                       error="E", message="m", final=True),
    messages.Heartbeat(),
]
MAY = {
    Role.SENSOR: {"get_status", "sensor_ready", "frame", "heartbeat"},
    Role.WORKER: {"get_status", "worker_ready", "job_failed", "heartbeat"},
    Role.PRESSER: {"get_status", "press", "withdraw"},
    Role.SUBSCRIBER: {"get_status", "get_face", "get_next", "find_start"},
    Role.OPERATOR: {"get_status", "list_dead", "retry_dead", "drop_dead", "purge",
                    "withdraw", "list_captures", "restart_sensor", "get_frame"},
}


@pytest.mark.parametrize("role", Role)
def test_a_role_may_say_this_and_nothing_else(role):
    may = {one.kind for one in SAID if missing_role(frozenset({role}), one) is None}
    assert may == MAY[role]


def test_every_kind_and_every_topic_has_its_roles():
    kinds = {one.model_fields["kind"].default for one in messages.TO_HUB}
    assert set(ROLES_BY_KIND) == kinds
    assert set(ROLES_BY_TOPIC) == set(Topic)
    assert all(roles and roles <= ALL_ROLES
               for roles in [*ROLES_BY_KIND.values(), *ROLES_BY_TOPIC.values()])


def test_no_worker_sensor_or_presser_reads_faces():
    for roles in (
            ROLES_BY_TOPIC[Topic.FACES], ROLES_BY_KIND["get_next"], ROLES_BY_KIND["get_face"]):
        assert not roles & {Role.WORKER, Role.SENSOR, Role.PRESSER}
    assert ROLES_BY_KIND["get_frame"] == {Role.OPERATOR}


def test_several_roles_add_up():
    both = frozenset({Role.PRESSER, Role.SUBSCRIBER})
    allowed = {one.kind for one in SAID if missing_role(both, one) is None}
    assert allowed == MAY[Role.PRESSER] | MAY[Role.SUBSCRIBER]


def test_what_the_hub_says_is_for_nobody_to_say():
    job = messages.Job(
        capture_id="a", attempt=1, settings=Settings(), settings_hash="0",
        frame_sha256="0" * 64, frame=FRAME)
    assert missing_role(ALL_ROLES, job)


@pytest.mark.parametrize("kind", [messages.GetFace, messages.GetFrame])
@pytest.mark.parametrize(("role", "own", "may"), [
    (Role.PRESSER, True, True), (Role.PRESSER, False, False), (Role.WORKER, True, False)])
def test_a_presser_gets_what_it_pressed(role, own, may, kind):
    lacks = missing_role(frozenset({role}), kind(request=1, capture_id="a"), own=own)
    assert (lacks is None) is may
    needed = {messages.GetFace: "get_face needs the role subscriber",
              messages.GetFrame: "get_frame needs the role operator"}[kind]
    pressed = ", or that the same key pressed it" if role is Role.PRESSER else ""
    assert may or lacks == needed + pressed


def test_refusals_are_all_counted_and_not_all_logged(capfd, monkeypatch):
    monkeypatch.setattr(sys, "stderr", sys.stderr)
    configure("text", "hub")
    counters = Counters()
    rejections = Rejections(counters)
    for number in range(1000):
        rejections.note("role", key="a")
        rejections.note("unknown key", key=f"stranger{number}", address=f"x:{number}")
    rejections.note("role", key="b")
    process_log.flush(LIMIT_S)
    structlog.reset_defaults()
    logged = capfd.readouterr().err
    assert (logged.count("key=a"), logged.count("key=stranger")) == (20, 20)
    assert logged.count("key=b") == 1
    assert counters.by_label("refused") == {"role": 1001, "unknown key": 1000}
