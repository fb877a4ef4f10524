"""The worker process, with a further job waiting."""

import threading

import cv2
import pytest

from denseface.recon import NoFaceError
from denseface.recon.numerics.compilation.progress import Progress
from denseface.recon.settings import Settings
from denseface.service.daemons import worker
from denseface.service.daemons.worker import _Worker
from denseface.service.protocol import messages
from denseface.service.protocol.payload import FrameHeader
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.background import Background
from denseface.service.settings import ServiceSettings
from tests.unit.service.faces import small_face, small_frame
from tests.waiting import LIMIT_S

FRAME, ARRAYS = FrameHeader.of(small_frame())
SETTINGS = ServiceSettings(address="ipc:///unused", heartbeat_s=0.05)
DONE = "the computation may end, and has"
BOTH_DONE = "both may end, and have"


def job(capture_id: str) -> Packet:
    return Packet(messages.Job(
        capture_id=capture_id, attempt=1, settings=Settings(), settings_hash="0f",
        frame_sha256="0" * 64, frame=FRAME), ARRAYS)


def cv2_error(code: int) -> cv2.error:
    error = cv2.error("as OpenCV says it")
    error.code = code
    return error


class Connection:
    """Gives a worker the messages of a script and notes what it sends."""

    def __init__(self, compute, script, gate):
        self.compute = compute
        self.gate = gate
        self.script = script
        self.up = True
        self.sent = []

    def send(self, message, _=None):
        if message.kind == "heartbeat":
            self.gate.release()
            return self.up
        if self.up:
            self.sent.append((message.kind, getattr(message, "capture_id", None)
                              or getattr(message, "credit", None)))
        return self.up

    def packets(self, *_):
        for one in self.script:
            if one is DONE:
                self.gate.release()
                assert self.compute.wait(LIMIT_S)
                yield None
            elif one is BOTH_DONE:
                self.gate.release(2)
                assert self.compute._calls[-1].exception(LIMIT_S) is None
                yield None
            elif isinstance(one, bool):
                self.up = one
            else:
                yield one


@pytest.fixture
def run(monkeypatch):
    """Have a worker serve a script; give it, and its connection with what it sent."""
    gate = threading.Semaphore(0)

    def reconstruct(job, *_):
        assert gate.acquire(timeout=LIMIT_S)
        if job.capture_id == "faceless":
            raise NoFaceError("none")
        return small_face()

    monkeypatch.setattr(worker, "_reconstruct", reconstruct)
    monkeypatch.setattr(worker, "_FINISH_S", LIMIT_S)
    with Background("recon") as compute:
        def serve(*script):
            connection = Connection(compute, script, gate)
            worker = _Worker(SETTINGS, connection, compute)
            worker.serve(object())
            return worker, connection
        yield serve


def test_it_asks_for_the_next_job_when_it_begins_one(run):
    _, connection = run(Packet(messages.Announce()), job("a"), job("b"), DONE, DONE)
    assert connection.sent == [
        ("worker_ready", 0), ("worker_ready", 1),
        ("worker_ready", 2), ("result", "a"),  # b is under way before a is answered
        ("result", "b")]


def test_while_it_compiles_it_says_how_far_it_is_and_asks_for_nothing(monkeypatch):
    may_end, sent = threading.Event(), []
    monkeypatch.setattr(worker, "warm", lambda: may_end.wait(LIMIT_S))
    monkeypatch.setattr(worker.compiling, "progress", Progress("compiling", 12, 63))

    class Hub:
        def packets(self, _, warming, heartbeat):
            sent.append(heartbeat().compiling)
            yield Packet(messages.Announce())
            assert len(sent) == 1
            may_end.set()
            assert warming.wait(LIMIT_S)
            yield None

        def send(self, message):
            sent.append(message)

    with Background("warm") as warming:
        one = _Worker(SETTINGS, Hub(), warming, name="w")
        assert one.start(object(), warming)
    assert sent == [messages.Compiling(name="w", done=12, total=63),
                    messages.WorkerReady(name="w", credit=0)]


def test_it_goes_on_after_a_frame_without_a_face(run):
    _, connection = run(job("faceless"), job("b"), DONE, DONE)
    assert connection.sent[1:] == [("worker_ready", 2), ("job_failed", "faceless"), ("result", "b")]


@pytest.mark.parametrize(("error", "final"), [
    (NoFaceError("none"), True), (ValueError("nan"), True), (ZeroDivisionError(), True),
    (IndexError("empty"), True), (cv2_error(cv2.Error.StsAssert), True),
    (cv2_error(cv2.Error.StsNoMem), False), (MemoryError(), False), (OSError("disk"), False)])
def test_what_a_frame_s_own_numbers_lead_to_is_not_tried_again(monkeypatch, error, final):
    def fails(*_):
        raise error

    monkeypatch.setattr(worker, "reconstruct", fails)
    (said,) = failures_of(SETTINGS)
    assert (said.error, said.final) == (type(error).__name__, final)


def test_a_frame_larger_than_allowed_is_not_begun(monkeypatch):
    monkeypatch.delattr(worker, "reconstruct")
    (said,) = failures_of(SETTINGS.model_copy(update={"max_frame_pixels": 69}))
    assert (said.error, said.final) == ("FrameTooLargeError", True)
    assert said.message.startswith("color has 10 x 7 pixels, at most 69 allowed")


def failures_of(settings):
    """Give what a worker says that fails at its one job."""
    with Background("recon") as compute:
        connection = Connection(compute, (job("a"), DONE), threading.Semaphore(0))
        said = []
        connection.send = lambda message, *_: said.append(message) or True
        _Worker(settings, connection, compute).serve(object())
    return [one for one in said if isinstance(one, messages.JobFailed)]


def test_a_third_job_is_dropped(run):
    _, connection = run(job("a"), job("b"), job("c"), DONE, DONE)
    assert [one for one in connection.sent if one[0] == "result"] == [
        ("result", "a"), ("result", "b")]


def test_answers_wait_for_the_hub_in_order(run):
    _, connection = run(job("a"), job("b"), False, DONE, DONE, True, None, None)
    assert connection.sent == [("worker_ready", 1), ("result", "a"), ("result", "b")]


def test_two_that_end_at_once_are_both_answered(run):
    _, connection = run(job("a"), job("b"), BOTH_DONE)
    assert connection.sent == [("worker_ready", 1), ("worker_ready", 2), ("result", "a"),
                         ("result", "b")]


def test_told_to_stop_it_answers_what_it_has_begun_and_begins_nothing(run):
    worker, connection = run(job("a"), job("b"))
    worker.finish()  # a may end at the first heartbeat
    assert connection.sent == [("worker_ready", 1), ("result", "a")]
    assert not worker.compute


def test_told_to_stop_it_finishes_the_job_that_followed_too(run):
    worker, connection = run(job("a"), job("b"))
    connection.gate.release()
    worker.compute._calls[0].result(LIMIT_S)
    while not worker.compute._calls[1].running():
        pass
    worker.finish()  # b may end at the first heartbeat
    assert connection.sent == [("worker_ready", 1), ("worker_ready", 2), ("result", "a"),
                         ("result", "b")]
    assert not worker.compute


def test_told_to_stop_it_sends_what_waited_for_the_hub(run):
    worker, connection = run(job("a"), False, DONE, True)
    worker.finish()
    assert connection.sent == [("worker_ready", 1), ("result", "a")]
