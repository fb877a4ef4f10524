"""A source read without an end, with a look ahead for previews."""

from pathlib import Path

import pytest

from denseface.capture.errors import SensorError, UnreadableSourceError
from denseface.service.daemons import sensor
from denseface.service.daemons.sensor import SensorReader
from tests.unit.service.faces import small_frame


class Recording:
    """A source of three frames, the second time of none."""

    uri = "x"

    def __init__(self):
        self.frames = [small_frame(seed) for seed in range(3)]
        self.closed = False

    def __iter__(self):
        yield from self.frames

    def look_closely(self, *, refuse):
        assert refuse

    def close(self):
        self.closed = True


class LiveCamera(Recording):
    """Goes on for ever, and counts how often it was flushed."""

    flushed = 0

    def __iter__(self):
        number = 0
        while True:
            number += 1
            yield small_frame(number)

    def flush(self):
        self.flushed += 1


def opened(monkeypatch, source):
    monkeypatch.setattr(sensor, "open_source", lambda *_, **__: source)
    reader = SensorReader("x", Path("unused"))
    reader.open()
    return reader


def test_a_preview_of_a_recording_shows_what_the_next_press_gives(monkeypatch):
    source = Recording()
    reader = opened(monkeypatch, source)
    assert not reader.live
    assert reader.peek() is reader.peek() is source.frames[0]
    assert reader.take() is source.frames[0]
    assert reader.take() is source.frames[1]
    assert reader.peek() is source.frames[2]
    assert [reader.take() is one for one in (source.frames[2], source.frames[0])] == [True, True]
    reader.close()
    assert source.closed


def test_an_error_of_a_recording_is_raised_for_the_press_too(monkeypatch):
    source = Recording()
    source.frames = []
    reader = opened(monkeypatch, source)
    for call in (reader.peek, reader.peek, reader.take):
        with pytest.raises(UnreadableSourceError, match="holds no pair"):
            call()


def test_a_press_after_a_preview_gets_no_frame_older_than_itself(monkeypatch):
    source = LiveCamera()
    reader = opened(monkeypatch, source)
    assert reader.live
    reader.take()
    assert source.flushed == 0
    reader.peek()
    reader.peek()
    reader.take()
    assert source.flushed == 1


def test_a_source_that_is_not_open_says_so():
    with pytest.raises(SensorError, match="is not open"):
        SensorReader("x", None).take()


def test_a_recording_that_is_to_be_played_once(monkeypatch):
    source = Recording()
    source.repeats = False
    reader = opened(monkeypatch, source)
    assert [reader.take() for _ in range(3)] == source.frames
    for _ in range(2):
        with pytest.raises(UnreadableSourceError, match="x: the recording is at its end"):
            reader.take()
