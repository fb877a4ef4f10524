"""Previews: one at a time, never before a press, only while somebody looks."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from denseface.capture.errors import SensorError, UnreadableSourceError
from denseface.recon.settings import Settings
from denseface.service.daemons import sensor as sensor_module
from denseface.service.daemons.sensor import Sensor
from denseface.service.daemons.shrink import shrunk
from denseface.service.hub.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Publish
from denseface.service.protocol.payload import MAX_PREVIEW_SIDE, PreviewHeader
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from denseface.service.storage.folder_store import FolderStore
from tests.unit.service.faces import small_frame
from tests.unit.service.hub.test_hub import OTHER, SENSOR, SETTINGS, Bench, kinds

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


def test_nobody_looks_and_nothing_is_asked_for(bench):
    assert bench.wait(1) == []
    assert previews(bench) == []


def test_one_is_asked_for_when_the_one_before_has_come(bench):
    bench.hub.show(wanted=True)
    assert kinds(bench.wait(0.2)) == [(SENSOR, "take_preview")]
    assert bench.wait(0.05) == []
    (first,) = previews(bench)
    assert previews(bench) == []  # a second one was not asked for
    assert bench.wait(0.0) == []  # nor so soon
    assert kinds(bench.wait(0.1)) == [(SENSOR, "take_preview")]
    (second,) = previews(bench)
    assert (first.epoch, first.sequence, second.sequence) == (second.epoch, 1, 2)
    assert first.epoch != bench.store.epoch


def test_one_that_is_lost_is_asked_for_again(bench):
    bench.hub.show(wanted=True)
    bench.wait(0.2)
    bench.say(SENSOR, messages.Heartbeat())
    assert kinds(bench.wait(1.0)) == [(SENSOR, "take_preview")]


def test_only_the_sensor_that_was_asked_is_believed(bench):
    bench.hub.show(wanted=True)
    bench.wait(0.2)
    assert previews(bench, OTHER) == []
    assert len(previews(bench)) == 1


def test_no_preview_while_a_press_waits_for_its_frame(bench):
    bench.hub.show(wanted=True)
    bench.press()
    assert bench.wait(0.2) == []
    bench.frame()
    assert kinds(bench.wait(0.2)) == [(SENSOR, "take_preview")]


def test_who_looks_no_more_gets_no_more(bench):
    bench.hub.show(wanted=True)
    bench.wait(0.2)
    bench.hub.show(wanted=False)
    assert previews(bench) == []
    assert bench.wait(0.2) == []


def test_nothing_of_a_preview_is_kept(bench, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    bench.hub.show(wanted=True)
    bench.wait(0.2)
    assert len(previews(bench)) == 1
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(("width", "height"), [(MAX_PREVIEW_SIDE + 1, 4), (4, 321), (0, 4)])
def test_the_size_is_limited_before_a_byte_is_read(width, height):
    with pytest.raises(ValidationError):
        PreviewHeader(width=width, height=height, timestamp_us=0)


@pytest.mark.parametrize(("shape", "small"), [
    ((480, 640), (240, 320)), ((1024, 1280), (256, 320)), ((240, 320), (240, 320)),
    ((7, 10), (7, 10)), ((1000, 3), (250, 1)), ((321, 321), (160, 160)), ((1, 5000), (1, 312))])
def test_pictures_are_made_small(shape, small):
    image = np.full((*shape, 3), (1, 100, 255), np.uint8)
    found = shrunk(image)
    assert (found.shape, found.dtype) == ((*small, 3), np.uint8)
    assert (found == (1, 100, 255)).all()


def test_a_small_pixel_is_the_mean_of_large_ones():
    image = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    np.testing.assert_array_equal(
        shrunk(image, 3), image.reshape(2, 2, 3, 2, 3).mean((1, 3)).astype(np.uint8))


class Recording:
    """A source of three frames, the second time of none."""

    uri = "x"

    def __init__(self):
        self.frames = [small_frame(seed) for seed in range(3)]
        self.closed = False

    def __iter__(self):
        yield from self.frames

    def close(self):
        self.closed = True


class LiveCamera(Recording):
    """Goes on for ever, and notes what was thrown away."""

    flushed = 0

    def __iter__(self):
        number = 0
        while True:
            number += 1
            yield small_frame(number)

    def flush(self):
        self.flushed += 1


def opened(monkeypatch, source):
    monkeypatch.setattr(sensor_module, "open_source", lambda *_, **__: source)
    sensor = Sensor("x", Path("unused"))
    sensor.open()
    return sensor


def test_what_is_seen_of_a_recording_is_what_the_next_press_gives(monkeypatch):
    source = Recording()
    sensor = opened(monkeypatch, source)
    assert not sensor.live
    assert sensor.look() is sensor.look() is source.frames[0]
    assert sensor.take() is source.frames[0]
    assert sensor.take() is source.frames[1]
    assert sensor.look() is source.frames[2]
    assert [sensor.take() is one for one in (source.frames[2], source.frames[0])] == [True, True]
    sensor.close()
    assert source.closed


def test_what_is_wrong_with_a_recording_the_press_hears_too(monkeypatch):
    source = Recording()
    source.frames = []
    sensor = opened(monkeypatch, source)
    for call in (sensor.look, sensor.look, sensor.take):
        with pytest.raises(UnreadableSourceError, match="holds no pair"):
            call()


def test_a_press_after_a_look_gets_nothing_from_before_it(monkeypatch):
    source = LiveCamera()
    sensor = opened(monkeypatch, source)
    assert sensor.live
    sensor.take()
    assert source.flushed == 0
    sensor.look()
    sensor.look()
    sensor.take()
    assert source.flushed == 1


def test_a_source_that_is_not_open_says_so():
    with pytest.raises(SensorError, match="is not open"):
        Sensor("x", None).take()
