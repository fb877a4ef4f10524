"""Purges and starts of a real hub with much to keep, by peers that speak the wire format alone."""

import subprocess
import sys
from contextlib import closing, contextmanager

import pytest

from bench.growth_captures import fill as fill_quickly
from denseface.service.protocol import messages
from tests.system.guarded import Peer
from tests.system.running import PATIENT, hub_alone
from tests.system.test_keeping import FRAME, FRAME_ARRAYS, address, files, fill
from tests.waiting import until

__all__ = ["address"]

NAME = "MargaretHamilton"


@pytest.fixture
def data(tmp_path):
    fill(tmp_path / "data", NAME, "b")
    return tmp_path / "data"


def named(data):
    return [path.name for path in data.iterdir()
            if path.is_file() and NAME.encode() in path.read_bytes()]


READER = """
import sqlite3, sys
database = sqlite3.connect(sys.argv[1], isolation_level=None)
database.execute("BEGIN")
database.execute("SELECT count(*) FROM captures").fetchone()
print(flush=True)
sys.stdin.read()
"""
"""A process of its own: this one loses its locks as soon as it looks into one of the files."""


@contextmanager
def reader(data):
    """Another program that reads the database and does not end its transaction."""
    process = subprocess.Popen([sys.executable, "-c", READER, data / "captures.sqlite3"],
                               stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert process.stdout.readline()
        yield
    finally:
        process.kill()  # who closes a database in order, as the last one, empties its log
        process.communicate()


def test_removed_is_said_when_no_file_and_no_log_names_it(address, data):
    with hub_alone(address, data), closing(Peer(address)) as peer:
        peer.status()
        with reader(data):
            peer.send(messages.Purge(request=1, capture_id=NAME))
            until(lambda: not [name for name in files(data) if NAME in name])
            peer.send(messages.GetStatus(request=2))
            answers = [peer.take()]
            if answers[0].kind != "status":  # late: that the log cannot be emptied is said by then
                assert "another program has the database open" in answers[0].message
                answers.append(peer.take())
            assert answers[-1].kind == "status"
            assert named(data)
        # Whichever comes first: that the log cannot be emptied, or that it is.
        answers = [peer.request(messages.Purge(request=1, capture_id=NAME))]
        while answers[-1].kind != "removed":
            assert "another program has the database open" in answers[-1].message
            answers.append(peer.request(
                messages.Purge(request=2 + len(answers), capture_id=NAME)))
        assert named(data) == []


def test_what_could_not_be_emptied_is_emptied_after_a_restart(address, data):
    with reader(data):
        with hub_alone(address, data), closing(Peer(address)) as peer:
            peer.send(messages.Purge(request=1, everything=True))
            until(lambda: not files(data))
        assert named(data)
    with hub_alone(address, data), closing(Peer(address)) as peer:
        until(lambda: not named(data))
        assert peer.status().done == 0


_READS_NO_FURTHER = """
import time
from pathlib import Path
from denseface.service.storage import Progress
count = Progress.count
def held(self):
    count(self)
    while not self.cancelled and not Path({flag!r}).exists():
        time.sleep(0.01)
Progress.count = held
"""
"""A hub that stops at its first file until there is a flag, or it is told to stop."""


def test_the_status_is_known_and_a_press_waits_while_the_database_is_made_again(
        address, tmp_path):
    data, kept, flag = tmp_path / "data", 2000, tmp_path / "flag"
    fill_quickly(data, kept)
    (data / "captures.sqlite3").unlink()
    with closing(Peer(address)) as sensor, closing(Peer(address)) as presser, \
            closing(Peer(address)) as watcher:
        # Said once, to a hub that is not there yet: nothing of it is lost.
        sensor.send(messages.SensorReady(name="s", source="x"))
        press = messages.Press(request=1, capture_id="press")
        presser.send(press)
        with hub_alone(address, data, code=_READS_NO_FURTHER.format(flag=str(flag)), **PATIENT):
            seen = [watcher.status()]
            flag.touch()
            while seen[-1].state != "serving":
                seen.append(watcher.status())
            assert {one.state for one in seen[:-1]} <= {"opening", "rebuilding"}
            assert seen[0].state != "serving"
            assert not seen[0].ready
            read = [one.files_read for one in seen[:-1]]
            assert read == sorted(read)
            assert max(one.files_to_read for one in seen) in (0, kept + kept * 8 // 10)
            while not sensor.socket.poll(100):  # it may have come before the sensor
                presser.send(press)
            take = sensor.receive("take").message
            sensor.send(messages.Frame(capture_id=take.capture_id, frame=FRAME), FRAME_ARRAYS)
            assert presser.receive("press_accepted").message.capture_id == "press"
            assert watcher.status().done == kept * 8 // 10


def test_a_hub_that_is_told_to_stop_while_it_reads_files_stops(address, tmp_path):
    data = tmp_path / "data"
    fill_quickly(data, 2000)
    (data / "captures.sqlite3").unlink()
    with closing(Peer(address)) as watcher:
        code = _READS_NO_FURTHER.format(flag=str(tmp_path / "none"))
        with hub_alone(address, data, code=code):  # stopped in order, with status 0
            until(lambda: watcher.status().state == "rebuilding")
        with hub_alone(address, data):
            until(lambda: watcher.status().state == "serving")
            assert watcher.status().done == 1600
