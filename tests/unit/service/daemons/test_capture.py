"""The capture process: a press goes before a preview, whatever the driver is at."""

from typing import ClassVar

import pytest
from structlog.testing import capture_logs

from denseface.capture.errors import SensorError, UnreadableSourceError
from denseface.service.daemons._reader_supply import ReaderSupply
from denseface.service.daemons._supply import SupplyState
from denseface.service.daemons.capture import _Capture, sensor_name
from denseface.service.protocol import messages
from denseface.service.protocol.messages import SensorReady
from denseface.service.protocol.wire import Packet
from denseface.service.settings import ServiceSettings
from tests.unit.service.faces import small_frame

ENDED = object()
"""The call under way ends."""
PREVIEW = messages.TakePreview()


def take(capture_id):
    return messages.Take(capture_id=capture_id)


def safe(capture_id):
    return messages.FrameAccepted(capture_id=capture_id)


class Driver:
    """Makes a call when its end is in the script."""

    elapsed_s = 0.0

    def __init__(self):
        self.call = None
        self.call_done = False

    def __bool__(self):
        return self.call is not None

    def start(self, call):
        assert self.call is None
        self.call = call

    def done(self):
        return self.call_done

    def result(self):
        call, self.call, self.call_done = self.call, None, False
        return call()


class Connection:
    """Gives the process the messages of a script and notes what it sends.

    A number in the script lets that many seconds pass.
    """

    now = 0.0
    step = 0

    def __init__(self, driver, script):
        self.driver = driver
        self.script = [ENDED, *script]  # first, the source is open
        self.sent = []

    def send(self, message, arrays=None):  # noqa: ARG002
        self.sent.append(message)
        return True

    def packets(self, *_):
        for one in self.script:
            if one is ENDED:
                self.driver.call_done = True
                yield None
            elif isinstance(one, float):
                Connection.now += one
                yield None
            else:
                yield Packet(one)


class FakeReader:
    """Gives a small frame, or an error."""

    uri = "x"

    def __init__(self, error=None, *, live):
        self.live = live
        self.error = error
        self.calls = []

    def open(self):
        """There is nothing to open."""

    def take(self):
        return self._give("take")

    def peek(self):
        return self._give("peek")

    def _give(self, name):
        self.calls.append(name)
        if self.error:
            raise self.error
        return small_frame()


def served(reader, *script):
    """Give what was sent, and the calls of the driver."""
    driver = Driver()
    connection = Connection(driver, script)
    settings = ServiceSettings(address="ipc:///unused")
    supply = ReaderSupply(reader, driver, settings.take_timeout_s)
    _Capture(settings, connection, supply, "x").serve(None)
    return [getattr(one, "capture_id", one.kind) for one in connection.sent
            if one.kind not in ("sensor_state", "sensor_ready")], reader.calls


def test_a_preview_is_sent_once_when_it_is_asked_for():
    assert served(FakeReader(live=True), PREVIEW, ENDED) == (["preview_frame"], ["peek"])


def test_a_press_goes_before_a_preview_that_is_asked_for_with_it():
    assert served(FakeReader(live=True), take("a"), PREVIEW, ENDED, safe("a")) == (
        ["a", "preview_frame"], ["take"])


def test_what_a_live_sensor_gives_for_a_preview_is_for_the_press_that_came_meanwhile():
    assert served(FakeReader(live=True), PREVIEW, take("a"), ENDED) == (
        ["a", "preview_frame"], ["peek"])


def test_a_second_press_goes_before_the_preview_too():
    assert served(FakeReader(live=True), PREVIEW, take("a"), take("b"), ENDED, ENDED) == (
        ["a", "b", "preview_frame"], ["peek", "take"])


def test_a_recording_s_press_takes_the_frame_that_was_peeked_at():
    # `SensorReader.take` gives it at once; the preview that is owed shows the one after.
    assert served(FakeReader(live=False), PREVIEW, take("a"), ENDED, ENDED, safe("a"), ENDED) == (
        ["a", "preview_frame"], ["peek", "take", "peek"])


def test_no_preview_while_a_frame_is_not_safe():
    assert served(FakeReader(live=False), take("a"), ENDED, PREVIEW) == (["a"], ["take"])


def test_a_frame_that_is_not_acknowledged_is_sent_again_at_growing_intervals(monkeypatch):
    def times(seconds, *then):
        monkeypatch.setattr(Connection, "now", 0.0)
        return len(served(FakeReader(live=False), take("a"), ENDED, *[1.0] * seconds, *then)[0])

    monkeypatch.setattr(
        "denseface.service.daemons._frame_sender.time.monotonic", lambda: Connection.now)
    sent = [times(seconds) for seconds in range(91)]
    assert [seconds for seconds in range(1, 91) if sent[seconds] > sent[seconds - 1]] == [
        2, 6, 14, 30, 60, 90]
    assert times(3, safe("a"), *[1.0] * 90) == times(3)


def test_a_preview_that_fails_is_no_frame_that_fails():
    error = UnreadableSourceError("damaged")
    assert served(FakeReader(error, live=False), PREVIEW, ENDED) == ([], ["peek"])
    assert served(FakeReader(error, live=False), PREVIEW, take("a"), ENDED, ENDED) == (
        ["a"], ["peek", "take"])


def test_a_sensor_that_went_away_ends_the_process_at_a_preview_too():
    with pytest.raises(SensorError, match="unplugged"):
        served(FakeReader(SensorError("unplugged"), live=True), PREVIEW, ENDED)


def test_a_frame_larger_than_allowed_is_not_sent():
    driver = Driver()
    connection = Connection(driver, [take("a"), ENDED, 100.0])
    settings = ServiceSettings(address="ipc:///unused", max_frame_pixels=69)
    supply = ReaderSupply(FakeReader(live=False), driver, 1.0)
    _Capture(settings, connection, supply, "x").serve(None)
    said = connection.sent[-1]
    assert (said.kind, said.capture_id) == ("frame_failed", "a")
    assert said.message.startswith("color has 10 x 7 pixels, at most 69 allowed")


def test_the_hub_is_told_each_state_once_and_again_when_it_asks():
    driver = Driver()
    connection = Connection(driver, [0.0, messages.Announce(), 0.0])
    supply = ReaderSupply(FakeReader(live=False), driver, 1.0)
    _Capture(ServiceSettings(address="ipc:///unused"), connection, supply, "x").serve(None)
    assert [one.state for one in connection.sent if one.kind == "sensor_state"] == [
        "streaming", "streaming"]


@pytest.mark.parametrize(("source", "identity", "name"), [
    ("openni2:", "", "openni2"), ("openni2:", "B0012", "B0012"), ("OpenNI2:usb 1/2", "", "usb-1/2"),
    ("/a/face 1.oni", "", "face-1"), ("", "", "sensor"), ("x" * 200 + ".oni", "", "x" * 100)])
def test_a_sensor_without_a_name_is_named_after_its_identity_or_its_source(source, identity, name):
    assert sensor_name(source, identity) == name
    SensorReady(name=name, source=source)


def test_of_a_recording_a_burst_is_one_frame_of_the_next_ones():
    driver, reader = Driver(), FakeReader(live=False)
    connection = Connection(driver, [messages.Take(capture_id="a", frames=3), ENDED, safe("a")])
    _Capture(ServiceSettings(address="ipc:///unused"), connection,
             ReaderSupply(reader, driver, 10.0), "x").serve(None)
    assert reader.calls == ["take"] * 3
    (frame,) = [one for one in connection.sent if one.kind == "frame"]
    assert frame.frame.fused == 3


def test_each_state_is_logged_once_until_it_streams_again():
    class Supply:
        states: ClassVar = [("blocked", "busy"), ("opening", "o"), ("blocked", "busy"),
                            ("streaming", ""), ("blocked", "busy"), ("streaming", "")]
        wake = None

        @property
        def state(self):
            return SupplyState(*self.states[min(Connection.step, len(self.states) - 1)])

        def hangs(self):
            return ""

        def step(self, *, busy):  # noqa: ARG002
            Connection.step += 1
            return iter(())

    Connection.step = -1
    connection = Connection(Driver(), [0.0] * 7)
    with capture_logs() as lines:
        _Capture(ServiceSettings(address="ipc:///unused"), connection, Supply(), "x").serve(None)
    assert [line["state"] for line in lines] == [
        "blocked", "opening", "streaming", "blocked", "streaming"]
