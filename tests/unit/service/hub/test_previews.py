"""Previews: one at a time, never before a press, only while somebody looks."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.outgoing import Publish
from denseface.service.protocol.payload import MAX_PREVIEW_SIDE, PreviewHeader
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore
from tests.unit.service.faces import jpeg
from tests.unit.service.hub.bench import CLIENT, OTHER, SENSOR, SETTINGS, Bench, kinds

IMAGE = {"image": np.zeros((3, 4, 3), np.uint8)}
SHOWN = messages.PreviewFrame(preview=PreviewHeader(width=4, height=3, timestamp_us=5))


@pytest.fixture
def bench(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        bench = Bench(Hub(store, SETTINGS, Settings()), store)
        bench.sensor()
        yield bench


def published(bench, topic, message, arrays=None, peer=SENSOR):
    return [one.packet.message for one in bench.hub.receive(
        bench.now, peer, Packet(message, arrays or {}))
        if isinstance(one, Publish) and one.topic is topic]


def previews(bench, peer=SENSOR, message=SHOWN, arrays=IMAGE):
    return published(bench, Topic.PREVIEW, message, arrays, peer)


def say_state(bench, state, peer=SENSOR, name="s"):
    return bench.say(peer, messages.SensorState(name=name, state=state))


def test_without_a_subscriber_no_preview_is_asked_for(bench):
    assert bench.wait(1) == []
    assert previews(bench) == []


def test_a_preview_is_asked_for_when_the_last_has_come(bench):
    bench.hub.want_previews(wanted=True)
    assert kinds(bench.wait(0.2)) == [(SENSOR, "take_preview")]
    assert bench.wait(0.02) == []
    (first,) = previews(bench)
    assert previews(bench) == []  # a second one was not asked for
    assert bench.wait(0.0) == []  # nor so soon
    assert kinds(bench.wait(0.02)) == [(SENSOR, "take_preview")]
    (second,) = previews(bench)
    assert (first.epoch, first.sequence, second.sequence) == (second.epoch, 1, 2)
    assert first.epoch != bench.store.epoch


def test_a_preview_that_is_lost_is_asked_for_again(bench):
    bench.hub.want_previews(wanted=True)
    bench.wait(0.2)
    bench.say(SENSOR, messages.Heartbeat())
    assert kinds(bench.wait(1.0)) == [(SENSOR, "take_preview")]


def test_only_the_sensor_that_was_asked_may_send_a_preview(bench):
    bench.hub.want_previews(wanted=True)
    bench.wait(0.2)
    assert previews(bench, OTHER) == []
    assert len(previews(bench)) == 1


def test_no_preview_while_a_press_waits_for_its_frame(bench):
    bench.hub.want_previews(wanted=True)
    bench.press()
    assert bench.wait(0.2) == []
    bench.frame()
    assert kinds(bench.wait(0.2)) == [(SENSOR, "take_preview")]


def test_without_subscribers_a_late_preview_is_dropped(bench):
    bench.hub.want_previews(wanted=True)
    bench.wait(0.2)
    bench.hub.want_previews(wanted=False)
    assert previews(bench) == []
    assert bench.wait(0.2) == []


def test_a_press_that_waits_for_a_good_frame_does_not_stop_the_mirror(bench):
    bench.hub.want_previews(wanted=True)
    bench.say(CLIENT, messages.Press(request=1, capture_id="a", gate="wait"))
    assert kinds(bench.wait(0.2)) == [(SENSOR, "take_preview")]


def test_each_sensor_that_streams_is_asked_by_itself(bench):
    bench.say(OTHER, messages.SensorReady(name="o", source="openni2:"))
    bench.hub.want_previews(wanted=True)
    assert sorted(kinds(bench.wait(0.2))) == [(OTHER, "take_preview"), (SENSOR, "take_preview")]
    assert [one.preview.sensor for one in previews(bench, OTHER)] == ["o"]
    assert kinds(bench.wait(0.1)) == [(OTHER, "take_preview")]
    say_state(bench, "stalled", OTHER, "o")
    assert [one.preview.sensor for one in previews(bench)] == ["s"]
    assert kinds(bench.wait(2.0)) == [(SENSOR, "take_preview")]


def test_the_loop_knows_when_the_next_preview_is_due(bench):
    assert bench.hub.due() == math.inf
    bench.hub.want_previews(wanted=True)
    assert bench.hub.due() <= bench.now
    bench.wait(0.0)
    assert bench.hub.due() == bench.now + SETTINGS.heartbeat_s
    bench.now += 0.005
    previews(bench)
    assert 0.02 < bench.hub.due() - bench.now < 0.034
    bench.press()
    assert bench.hub.due() == math.inf  # the loop does not spin while a press waits


def test_many_sensors_share_the_rate(bench):
    for number in range(12):
        bench.say(b"%d" % number, messages.SensorReady(name=f"n{number}", source="x"))
    bench.hub.want_previews(wanted=True)
    bench.wait(0.0)
    previews(bench)
    assert 0.1 < bench.hub._previews.next_due(set()) - bench.now < 0.2


def test_a_jpeg_is_passed_on_with_its_hint_and_its_sensor(bench):
    hint = Hint(timestamp_us=4, codes=("too_far",), text="come closer")
    header, arrays = PreviewHeader.of_jpeg(jpeg(40, 30), 5, hint)
    bench.hub.want_previews(wanted=True)
    bench.wait(0.2)
    claims = header.model_copy(update={"sensor": "another"})
    (shown,) = previews(bench, message=messages.PreviewFrame(preview=claims), arrays=arrays)
    assert (shown.preview.hint, shown.preview.sensor) == (hint, "s")


def test_what_is_no_jpeg_is_not_passed_on(bench):
    header, arrays = PreviewHeader.of_jpeg(jpeg(40, 30), 5)
    bench.hub.want_previews(wanted=True)
    bench.wait(0.2)
    garbled = {"jpeg": arrays["jpeg"][::-1]}
    assert previews(bench, message=messages.PreviewFrame(preview=header), arrays=garbled) == []
    assert bench.hub._status.make().refused == {"malformed": 1}
    assert kinds(bench.wait(0.2)) == []  # and not at once again
    assert kinds(bench.wait(1.0)) == [(SENSOR, "take_preview")]


HINT = messages.QualityHint(hint=Hint(timestamp_us=4, codes=("too_far",), text="come closer"))


def test_without_a_subscriber_no_hint_is_asked_for_or_passed_on(bench):
    assert bench.wait(1) == []
    assert published(bench, Topic.HINTS, HINT) == []


def test_hints_are_asked_for_at_each_heartbeat_and_published_under_the_sensors_name(bench):
    bench.hub.want_hints(wanted=True)
    ((peer, asked),) = bench.wait(0.2)
    assert (peer, asked.kind, asked.seconds) == (SENSOR, "take_hints", 3 * SETTINGS.heartbeat_s)
    assert bench.wait(0.2) == []
    (said,) = published(bench, Topic.HINTS, HINT)
    assert (said.sensor, said.hint) == ("s", HINT.hint)
    assert kinds(bench.wait(1.0)) == [(SENSOR, "take_hints")]
    assert published(bench, Topic.HINTS, HINT, peer=OTHER) == []


def test_hints_that_come_too_fast_are_dropped(bench):
    bench.hub.want_hints(wanted=True)
    bench.wait(0.2)
    assert sum(len(published(bench, Topic.HINTS, HINT)) for _ in range(50)) == 1
    bench.now += 0.1
    assert len(published(bench, Topic.HINTS, HINT)) == 1


def test_no_preview_is_stored(bench, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    bench.hub.want_previews(wanted=True)
    bench.wait(0.2)
    assert len(previews(bench)) == 1
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(("width", "height"), [(MAX_PREVIEW_SIDE + 1, 4), (4, 641), (0, 4)])
def test_the_size_is_limited_before_a_byte_is_read(width, height):
    with pytest.raises(ValidationError):
        PreviewHeader(width=width, height=height, timestamp_us=0)
