"""Wherever the log goes, the service goes on, and says how many lines were lost."""

import fcntl
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import psutil
import pytest

from denseface.service.protocol import messages
from tests.system.guarded import FRAME, FRAME_ARRAYS, Peer, guarded_hub
from tests.system.running import PACE, RECORDINGS, REPOSITORY, denseface, wait_ready
from tests.waiting import LIMIT_S, until

_PEERS = PACE | {"DENSEFACE_HEARTBEAT_S": "1", "DENSEFACE_LIVENESS": "100"}
"""The peers here send no heartbeats: none is to count as gone before its test is through."""
_PIPE_BYTES = 4096
"""Smallest buffer that Linux gives a pipe."""
_SHORT_QUEUE = ("from denseface.service.log import output\n"
                "output._MAX_BYTES = 500\n")
"""Python that makes a stalled log lose lines soon."""


@contextmanager
def broken(how: str) -> Iterator[tuple[int, list[str]]]:
    """Give a descriptor for stderr, and what stands before the command that gets it."""
    with ExitStack() as stack:
        prefix = []
        if how == "full disk":
            stderr = os.open("/dev/full", os.O_WRONLY)
        elif how == "closed":
            stderr = os.open(os.devnull, os.O_WRONLY)
            prefix = ["sh", "-c", 'exec "$@" 2>&-', "sh"]
        else:
            reader, stderr = os.pipe()
            if how == "reader left":
                os.close(reader)
            else:
                stack.callback(os.close, reader)
                fcntl.fcntl(stderr, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
                os.write(stderr, b"\n" * _PIPE_BYTES)
        stack.callback(os.close, stderr)
        yield stderr, prefix


BROKEN = ("full disk", "reader left", "reader stalls", "closed")


@pytest.mark.parametrize("how", BROKEN)
def test_a_hub_whose_log_is_broken_answers_presses_and_stops_in_order(how, tmp_path):
    with broken(how) as (stderr, prefix), tempfile.TemporaryDirectory(prefix="df-") as short:
        address = f"ipc://{short}/hub"
        process = subprocess.Popen(
            [*prefix, sys.executable, "-c", f"import sys\n{_SHORT_QUEUE}"
             "from denseface.service.cli import main\nsys.exit(main(sys.argv[1:]))",
             "hub", "--address", address, "--data", str(tmp_path / "data")],
            cwd=REPOSITORY, stderr=stderr, env=os.environ | _PEERS)
        sensor, presser = Peer(address), Peer(address)
        try:
            sensor.send(messages.SensorReady(name="s", source="x"))
            until(lambda: presser.poll_status().sensors)
            for number in range(1, 6):
                capture_id = f"a{number}"
                presser.send(messages.Press(request=number, capture_id=capture_id))
                assert sensor.receive("take").message.capture_id == capture_id
                sensor.send(messages.Frame(capture_id=capture_id, frame=FRAME), FRAME_ARRAYS)
                presser.receive("press_accepted")
            until(lambda: presser.poll_status().log_lines_lost >= 3)
            assert process.poll() is None
            process.send_signal(signal.SIGTERM)
            assert process.wait(LIMIT_S) == 0
        finally:
            process.kill()
            process.wait()
            sensor.close()
            presser.close()


@pytest.mark.parametrize("how", ["full disk", "reader stalls"])
def test_a_service_whose_log_is_broken_makes_faces_and_stops_in_order(how, tmp_path):
    with broken(how) as (stderr, _), tempfile.TemporaryDirectory(prefix="df-") as short:
        address = f"ipc://{short}/hub"
        process = subprocess.Popen(
            [sys.executable, "-m", "denseface", "up", "--workers", "1", "--address", address,
             "--source", str(RECORDINGS / "frontal_700.oni"), "--data", str(tmp_path / "data")],
            cwd=REPOSITORY, stderr=stderr, env=os.environ | PACE)
        try:
            wait_ready(address)
            pressed = denseface("press", "--address", address)
            assert pressed.returncode in (0, 1), pressed.stderr
            status = json.loads(denseface("status", "--json", "--address", address).stdout)
            assert status["done"] + status["failed"] == 1
            assert (status["log_lines_lost"] > 0) == (how == "full disk")
            hub, *_ = (one for one in psutil.Process(process.pid).children()
                       if "hub" in one.cmdline())
            assert process.poll() is None
            process.send_signal(signal.SIGTERM)
            assert process.wait(LIMIT_S) == 0
            assert not hub.is_running()
        finally:
            if process.poll() is None:
                family = psutil.Process(process.pid).children(recursive=True)
                process.kill()
                for one in family:
                    one.kill()
            process.wait()


EVIL = "\x1b[2J\x1b]0;owned\x07\x9b31m gpj.\u202eexe\r\n2026-01-01T00:00:00Z [info] all is well"


def test_what_a_peer_says_is_obeyed_by_no_terminal(tmp_path):
    with guarded_hub(tmp_path, DENSEFACE_ATTEMPTS="1") as hub:
        sensor, worker, presser = (hub.peer(name) for name in ("sensor", "worker", "presser"))
        try:
            sensor.send(messages.SensorReady(name="s", source=EVIL))
            until(lambda: hub.status().sensors)
            for number, final in enumerate((True, False), 1):
                worker.send(messages.WorkerReady(name="w", credit=number))
                presser.send(messages.Press(request=number, capture_id=f"p{number}"))
                sensor.receive("take")
                sensor.send(messages.Frame(capture_id=f"p{number}", frame=FRAME), FRAME_ARRAYS)
                job = worker.receive("job").message
                worker.send(messages.JobFailed(
                    capture_id=f"p{number}", settings_hash=job.settings_hash,
                    frame_sha256=job.frame_sha256, error=EVIL, message=EVIL, final=final))
            until(lambda: hub.status().dead == 1)
            shown = [denseface(*command, "--address", hub.local) for command in (
                ("subscribe", "--after", "0", "--count", "2"), ("dead", "list"), ("status",),
                ("press", "--id", "p1"))]
        finally:
            for one in (sensor, worker, presser):
                one.close()
    texts = [text for one in shown for text in (one.stdout, one.stderr)]
    assert "p1 failed" in texts[0]
    assert r"\x1b[2J" in texts[0]
    assert r"\x1b[2J" in texts[2]
    assert r"\x1b[2J" in texts[-1]
    logged = until(lambda: r"\x1b[2J" in (text := hub.log.read_bytes().decode()) and text)
    for line in "".join([*texts, logged]).split("\n"):
        assert line.isprintable()
        assert not line.startswith("2026-01-01T")


def _refused_for_want_of_a_sensor(presser: Peer) -> bool:
    """Press as long as the hub waits for the sensors that it may have had before it started."""
    presser.send(messages.Press(request=0, capture_id="p0"))
    return bool(presser.socket.poll(100))


def test_who_floods_the_log_does_not_fill_it(tmp_path):
    with guarded_hub(tmp_path, DENSEFACE_LIVENESS="2") as hub:
        presser, worker = hub.peer("presser"), hub.peer("worker")
        try:
            until(lambda: _refused_for_want_of_a_sensor(presser))
            for number in range(1, 501):  # there is no sensor: each is refused
                presser.send(messages.Press(request=number, capture_id=f"p{number}"))
                worker.send(messages.WorkerReady(name=f"w{number}", credit=0))
                worker.send(messages.Goodbye())
            until(lambda: hub.status().presses_refused.get("no_sensor", 0) > 500)
            text = until(lambda: "lines suppressed" in hub.log.read_text() and hub.log.read_text())
            assert text.count("press refused") < 100
            assert len(text.splitlines()) < 1000
            # It hides nobody else.
            other = hub.peer("operator")
            other.send(messages.WorkerReady(name="x", credit=0))
            until(lambda: "key=operator" in hub.log.read_text())
            other.close()
        finally:
            presser.close()
            worker.close()


def test_a_log_without_ids_names_no_capture_in_any_process(tmp_path):
    log = tmp_path / "log"
    with tempfile.TemporaryDirectory(prefix="df-") as short, log.open("w") as stderr:
        address = f"ipc://{short}/hub"
        process = subprocess.Popen(
            [sys.executable, "-m", "denseface", "up", "--workers", "1", "--address", address,
             "--source", str(RECORDINGS / "frontal_700.oni"), "--data", str(tmp_path / "data")],
            cwd=REPOSITORY, stderr=stderr, env=os.environ | PACE | {"DENSEFACE_LOG_IDS": "off"})
        try:
            wait_ready(address)
            pressed = denseface("press", "--id", "Visitor-17", "--address", address)
            assert pressed.returncode == 0, pressed.stderr
        finally:
            process.terminate()
            assert process.wait(LIMIT_S) == 0
    text = log.read_text()
    assert "Visitor-17" not in text
    ids = {word for word in text.split() if word.startswith("capture_id=")}
    assert len(ids) == 1  # of hub, capture process and worker
