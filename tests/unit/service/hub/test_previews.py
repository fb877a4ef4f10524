"""Previews: one at a time, never before a press, only while somebody looks."""

import numpy as np
import pytest
from pydantic import ValidationError

from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Publish
from denseface.service.protocol.payload import MAX_PREVIEW_SIDE, PreviewHeader
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore
from tests.unit.service.hub.bench import OTHER, SENSOR, SETTINGS, Bench, kinds

IMAGE = {"image": np.zeros((3, 4, 3), np.uint8)}
SHOWN = messages.PreviewFrame(preview=PreviewHeader(width=4, height=3, timestamp_us=5))


@pytest.fixture
def bench(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        bench = Bench(Hub(store, SETTINGS, Settings()), store)
        bench.sensor()
        yield bench


def previews(bench, peer=SENSOR):
    return [one.packet.message for one in bench.hub.receive(
        bench.now, peer, Packet(SHOWN, IMAGE))
        if isinstance(one, Publish) and one.topic is Topic.PREVIEW]


def test_without_a_subscriber_no_preview_is_asked_for(bench):
    assert bench.wait(1) == []
    assert previews(bench) == []


def test_a_preview_is_asked_for_when_the_last_has_come(bench):
    bench.hub.want_previews(wanted=True)
    assert kinds(bench.wait(0.2)) == [(SENSOR, "take_preview")]
    assert bench.wait(0.05) == []
    (first,) = previews(bench)
    assert previews(bench) == []  # a second one was not asked for
    assert bench.wait(0.0) == []  # nor so soon
    assert kinds(bench.wait(0.1)) == [(SENSOR, "take_preview")]
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
