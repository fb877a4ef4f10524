"""Withdrawals from a real hub that is killed or asked by strangers; its folder is searched."""

import os
import signal
import subprocess
import sys
from contextlib import closing, contextmanager
from datetime import UTC, datetime

import pytest

from denseface.recon.face import Consent
from denseface.service.client import Client
from denseface.service.errors import PressRefusedError, UnknownCaptureError
from denseface.service.protocol import messages
from denseface.service.protocol.roles import Role
from denseface.service.runtime.failpoints import REMOVAL_FAILPOINTS
from tests.system.guarded import FACE, FACE_ARRAYS, FRAME, FRAME_ARRAYS, Peer, guarded_hub
from tests.system.running import REPOSITORY
from tests.waiting import LIMIT_S, until

ID, VERSION = "MaryJackson", "a-text-like-no-other"
CONSENT = Consent(text_version=VERSION, language="en", at=datetime(2026, 1, 31, tzinfo=UTC))
CONTENTS = [array.tobytes()[:4096] for array in (
    FRAME_ARRAYS["depth"], FRAME_ARRAYS["color"], FACE_ARRAYS["dense_z"])]


def left(data):
    """Files that hold the capture's id, consent, frame or face, or are named by the id."""
    words = [ID.encode(), VERSION.encode(), *CONTENTS]
    return [path.name for path in data.rglob("*") if path.is_file() and (
        ID in path.name or any(word in path.read_bytes() for word in words))]


@contextmanager
def hub(folder, failpoints=""):
    """A hub at a socket file, with a sensor and a worker that do as the test says."""
    address = f"ipc://{folder}/h"
    process = subprocess.Popen(
        [sys.executable, "-m", "denseface", "hub", "--address", address, "--data",
         str(folder / "data")], cwd=REPOSITORY, stderr=subprocess.DEVNULL,
        env=os.environ | {"DENSEFACE_FAILPOINTS": failpoints, "DENSEFACE_LIVENESS": "100"})
    try:
        with closing(Peer(address)) as peer:
            yield process, peer, address
    finally:
        process.kill()
        process.wait()


def made(peer):
    """Press, be the sensor and the worker too, and have the face."""
    peer.send(messages.SensorReady(name="s", source="x"))
    peer.send(messages.WorkerReady(name="w", credit=0))
    peer.send(messages.Press(request=1, capture_id=ID, consent=CONSENT))
    peer.receive("take")
    peer.send(messages.Frame(capture_id=ID, frame=FRAME), FRAME_ARRAYS)
    job = peer.receive("job").message
    peer.send(messages.Result(
        capture_id=ID, settings_hash=job.settings_hash, frame_sha256=job.frame_sha256, face=FACE),
        FACE_ARRAYS)
    done = peer.request(messages.GetFace(request=2, capture_id=ID, wait_s=60))
    assert done.face.report.consent == CONSENT


@pytest.mark.parametrize("step", REMOVAL_FAILPOINTS[1:])
def test_a_hub_that_is_killed_while_it_removes_goes_on_when_it_is_asked_again(tmp_path, step):
    with hub(tmp_path, f"{step}=kill") as (process, peer, _):
        made(peer)
        assert set(left(tmp_path / "data")) > {f"{ID}.frame"}
        peer.send(messages.Withdraw(request=3, capture_id=ID))
        assert process.wait(LIMIT_S) == -signal.SIGKILL
    with hub(tmp_path) as (_, _, address), Client(address) as client:
        client.withdraw(ID, timeout=LIMIT_S)
        assert left(tmp_path / "data") == []
        with pytest.raises(UnknownCaptureError):
            client.get(ID, timeout=LIMIT_S)
        with pytest.raises(PressRefusedError, match="withdrawn"):
            client.press(ID, timeout=LIMIT_S)


def test_by_ids_that_it_guesses_a_presser_learns_nothing_and_removes_nothing(tmp_path):
    with guarded_hub(tmp_path) as guarded:
        guarded.new_key("stranger", Role.PRESSER)
        with (closing(Peer(guarded.local)) as inside, closing(guarded.peer("presser")) as presser,
              closing(guarded.peer("stranger")) as stranger, closing(guarded.peer("worker")) as bad,
              closing(guarded.peer("subscriber")) as reader):
            inside.send(messages.SensorReady(name="s", source="x"))
            inside.send(messages.WorkerReady(name="w", credit=0))
            until(lambda: guarded.status().ready)
            presser.send(messages.Press(request=1, capture_id=ID))
            inside.receive("take")
            said = [stranger.request(messages.Withdraw(request=number, capture_id=one))
                    for number, one in enumerate((ID, "nobodys"))]  # its frame is awaited
            inside.send(messages.Frame(capture_id=ID, frame=FRAME), FRAME_ARRAYS)
            presser.receive("press_accepted")
            said += [stranger.request(messages.Withdraw(request=number, capture_id=one))
                     for number, one in enumerate((ID, "nobodys"), 2)]
            assert said == [messages.Removed(request=number, removed=0, left=False)
                            for number in range(4)]
            for number, one in enumerate((ID, "nobodys"), 4):
                again = stranger.request(messages.Press(request=number, capture_id=one))
                assert (again.kind, again.message) == ("press_refused", "it was withdrawn")
                got = stranger.request(messages.GetFace(request=10 + number, capture_id=one))
                assert (got.kind, ID in got.message) == ("request_failed", False)
            for other in (bad, reader):
                refused = other.request(messages.Withdraw(request=1, capture_id=ID))
                assert "withdraw needs the role operator or presser" in refused.message
            assert "pressed by another" not in str(guarded.status().refused)
            assert left(tmp_path / "data")
            mine = presser.request(messages.Withdraw(request=3, capture_id=ID))
            assert (mine.removed, left(tmp_path / "data")) == (1, [])
