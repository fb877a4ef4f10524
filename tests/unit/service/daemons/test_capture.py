"""The capture process: a press goes before a preview, whatever the driver is at."""

import pytest

from denseface.capture.errors import SensorError, UnreadableSourceError
from denseface.service.daemons.capture import _Capture
from denseface.service.protocol import messages
from denseface.service.protocol.wire import Packet
from denseface.service.settings import ServiceSettings
from tests.unit.service.faces import small_frame

ENDED = object()
"""The call under way ends."""
LOOK = messages.TakePreview()


def take(capture_id):
    return messages.Take(capture_id=capture_id)


def safe(capture_id):
    return messages.FrameAccepted(capture_id=capture_id)


class Driver:
    """Does a call when it is told to."""

    elapsed_s = 0.0

    def __init__(self):
        self.call = None
        self.done = False

    def __bool__(self):
        return self.call is not None

    def start(self, call):
        assert self.call is None
        self.call = call

    def ended(self):
        return self.done

    def take(self):
        call, self.call, self.done = self.call, None, False
        return call()


class Link:
    """Tells the process one thing after the other and notes what it says and does.

    A number in its script is so many seconds.
    """

    now = 0.0

    def __init__(self, driver, script):
        self.driver = driver
        self.script = [ENDED, *script]
        self.sent = []

    def send(self, message, arrays=None):  # noqa: ARG002
        self.sent.append(message)
        return True

    def packets(self, *_):
        for one in self.script:
            if one is ENDED:
                self.driver.done = True
                yield None
            elif isinstance(one, float):
                Link.now += one
                yield None
            else:
                yield Packet(one)


class Eye:
    """A sensor."""

    uri = "x"

    def __init__(self, error=None, *, live):
        self.live = live
        self.error = error
        self.calls = []

    def open(self):
        """There is nothing to open."""

    def take(self):
        return self._give("take")

    def look(self):
        return self._give("look")

    def _give(self, name):
        self.calls.append(name)
        if self.error:
            raise self.error
        return small_frame()


def served(eye, *script):
    """Give what was sent, and the calls of the driver."""
    driver = Driver()
    link = Link(driver, script)
    _Capture(ServiceSettings(address="ipc:///unused"), link, eye, driver).serve(None)
    return [getattr(one, "capture_id", one.kind) for one in link.sent[1:]], eye.calls


def test_a_preview_is_sent_once_when_it_is_asked_for():
    assert served(Eye(live=True), LOOK, ENDED) == (["preview_frame"], ["look"])


def test_a_press_goes_before_a_preview_that_is_asked_for_with_it():
    assert served(Eye(live=True), take("a"), LOOK, ENDED, safe("a")) == (
        ["a", "preview_frame"], ["take"])


def test_what_a_live_sensor_gives_for_a_preview_is_for_the_press_that_came_meanwhile():
    assert served(Eye(live=True), LOOK, take("a"), ENDED) == (["a", "preview_frame"], ["look"])


def test_a_second_press_goes_before_the_preview_too():
    assert served(Eye(live=True), LOOK, take("a"), take("b"), ENDED, ENDED) == (
        ["a", "b", "preview_frame"], ["look", "take"])


def test_a_recording_s_press_takes_the_frame_that_was_looked_at():
    # `Sensor.take` gives it at once; the preview that is owed shows the one after.
    assert served(Eye(live=False), LOOK, take("a"), ENDED, ENDED, safe("a"), ENDED) == (
        ["a", "preview_frame"], ["look", "take", "look"])


def test_no_preview_while_a_frame_is_not_safe():
    assert served(Eye(live=False), take("a"), ENDED, LOOK) == (["a"], ["take"])


def test_a_frame_that_is_not_acknowledged_is_sent_again_at_growing_intervals(monkeypatch):
    def times(seconds, *then):
        monkeypatch.setattr(Link, "now", 0.0)
        return len(served(Eye(live=False), take("a"), ENDED, *[1.0] * seconds, *then)[0])

    monkeypatch.setattr("denseface.service.daemons.capture.time.monotonic", lambda: Link.now)
    sent = [times(seconds) for seconds in range(91)]
    assert [seconds for seconds in range(1, 91) if sent[seconds] > sent[seconds - 1]] == [
        2, 6, 14, 30, 60, 90]
    assert times(3, safe("a"), *[1.0] * 90) == times(3)


def test_a_preview_that_fails_is_no_frame_that_fails():
    error = UnreadableSourceError("damaged")
    assert served(Eye(error, live=False), LOOK, ENDED) == ([], ["look"])
    assert served(Eye(error, live=False), LOOK, take("a"), ENDED, ENDED) == (
        ["a"], ["look", "take"])


def test_a_sensor_that_went_away_ends_the_process_at_a_preview_too():
    with pytest.raises(SensorError, match="unplugged"):
        served(Eye(SensorError("unplugged"), live=True), LOOK, ENDED)
