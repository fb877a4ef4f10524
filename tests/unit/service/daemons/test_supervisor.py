"""The process table and its supervisor."""

import os
import signal
import sys
import threading
from functools import partial
from pathlib import Path

import pytest

from denseface.service.daemons._watched_process import (
    AttendedClock,
    ProcessSpec,
    WatchedProcess,
    _ending,
)
from denseface.service.daemons.supervisor import Supervisor, process_table
from tests.system.running import RECORDINGS
from tests.waiting import LIMIT_S, until

_WATCHED = "denseface.service.daemons._watched_process"


@pytest.fixture
def run_in_turn(tmp_path, monkeypatch):
    """Have a supervisor run one program after the other in place of `denseface`; give its status.

    In each, `say` says a sign of life, and `kill` sends a signal to itself. However long this
    machine takes to start it, time passes where it says so: a look of the supervisor's at
    `look()`, and all of them from `looks_on()` until its end.
    """
    waiting, looks = tmp_path / "waiting", tmp_path / "looks"
    waiting.mkdir()
    looks.touch()
    waited = 0.0

    def told_time():
        nonlocal waited
        waited += any(Path("/proc", one.name).exists() for one in waiting.iterdir())
        return waited + looks.stat().st_size

    monkeypatch.setattr("denseface.service.daemons.supervisor.AttendedClock",
                        partial(AttendedClock, clock=told_time))

    def run(*programs, hang_timeout_s=60.0):
        fake = tmp_path / "fake"
        fake.write_text("\n".join([
            f"#!{sys.executable} -SE", "import os, signal, time",
            f"turn = os.open({str(tmp_path / 'turn')!r}, os.O_CREAT | os.O_WRONLY | os.O_APPEND)",
            "os.write(turn, b'.')",
            "def say(beat): os.write(int(os.environ['DENSEFACE_SUPERVISOR']), beat)",
            f"def look(): open({str(looks)!r}, 'a').write('.')",
            f"def looks_on(): open({str(waiting)!r} + f'/{{os.getpid()}}', 'x')",
            "def kill(number): os.kill(os.getpid(), number)",
            f"exec({programs!r}[os.fstat(turn).st_size - 1])"]))
        fake.chmod(0o700)
        monkeypatch.setattr(f"{_WATCHED}.sys.executable", str(fake))
        monkeypatch.setattr(f"{_WATCHED}._BACKOFF_S", 0.0)
        return Supervisor([ProcessSpec("x", ())], hang_timeout_s).run()

    return run


def test_the_table_names_what_runs():
    table = process_table(
        2, ["--address=ipc:///x"], hub=["--data=d"], captures=[["--source=x.oni"]])
    assert [row.name for row in table] == ["hub", "capture", "worker-1", "worker-2"]
    assert table[0].arguments == ("hub", "--data=d", "--address=ipc:///x")
    assert table[1].arguments == ("capture", "--source=x.oni", "--address=ipc:///x")
    assert table[2].environment["OMP_NUM_THREADS"] == "1"


def test_the_page_for_visitors_is_in_the_table_where_it_is_wanted_and_nobody_depends_on_it():
    *others, kiosk = process_table(
        1, ["--address=ipc:///x"], hub=[], captures=[[]], kiosk=["--kiosk-countdown=0"])
    assert kiosk.arguments == ("kiosk", "--kiosk-countdown=0", "--address=ipc:///x")
    assert not kiosk.vital
    assert not kiosk.needed
    assert all(one.needed for one in others)


def test_each_source_has_a_capture_process_of_its_own():
    table = process_table(1, [], hub=[], captures=[["--source=a"], ["--source=b"]])
    assert [(one.name, one.arguments) for one in table[1:3]] == [
        ("capture-1", ("capture", "--source=a")), ("capture-2", ("capture", "--source=b"))]


def test_restarts_come_later_and_later_until_it_is_a_storm():
    process = WatchedProcess(ProcessSpec("x", ()))
    delays, calm = [], []
    for now in range(6):
        calm.append(process.plan_restart(now))
        delays.append(process.due - now)
    assert delays == [0.5, 1, 2, 4, 8, 16]
    assert calm == [True] * 5 + [False]


def test_an_old_restart_is_forgotten():
    process = WatchedProcess(ProcessSpec("x", ()))
    assert all(process.plan_restart(now * 30.0) for now in range(20))
    assert process.due == 19 * 30 + 2


def test_wrong_usage_of_a_child_ends_all_with_status_2():
    assert Supervisor([ProcessSpec("x", ("no-such-command",))]).run() == 2


@pytest.mark.parametrize("source", ["openni2:", str(RECORDINGS / "frontal_700.oni")])
def test_a_missing_library_ends_all_with_status_2_and_one_line(source, tmp_path, capfd):
    capture = ProcessSpec(
        "capture", ("capture", "--source", source, "--address", f"ipc://{tmp_path}/h"),
        {"OPENNI2_REDIST64": str(tmp_path)}, vital=False)
    assert Supervisor([capture]).run() == 2
    said = [line for line in capfd.readouterr().err.splitlines() if "OPENNI2" in line]
    assert said == [
        f"denseface capture: OPENNI2_REDIST64={tmp_path}: no libOpenNI2.so in that folder"]


def test_wrong_usage_of_a_child_that_is_not_needed_ends_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(f"{_WATCHED}._BACKOFF_S", 0.0)
    table = [ProcessSpec("hub", ("hub", "--address", f"ipc://{tmp_path}/h",
                                 "--data", str(tmp_path / "data"))),
             ProcessSpec("x", ("no-such-command",), vital=False, needed=False)]
    supervisor = Supervisor(table)
    stopper = threading.Thread(target=lambda: (
        until(lambda: supervisor._processes[1].counts["exited"] > 1),
        os.kill(os.getpid(), signal.SIGTERM)))
    stopper.start()
    assert supervisor.run() == 0
    stopper.join()


def test_a_storm_ends_all_with_status_1(monkeypatch):
    monkeypatch.setattr(f"{_WATCHED}._BACKOFF_S", 0.0)
    monkeypatch.setattr(f"{_WATCHED}._STORM_RESTARTS", 1)
    assert Supervisor([ProcessSpec("x", ("status", "--address", "ipc:///none", "--wait", "0.01"))
                       ]).run() == 1


def test_a_process_that_does_not_end_in_time_is_killed(tmp_path, monkeypatch, capsys):
    stubborn = tmp_path / "stubborn"
    stubborn.write_text("#!/bin/sh\ntrap '' TERM\necho $$ >\"$(dirname \"$0\")/pid\"\n"
                        "while :; do sleep 1; done\n")
    stubborn.chmod(0o700)
    monkeypatch.setattr(f"{_WATCHED}.sys.executable", str(stubborn))
    monkeypatch.setattr("denseface.service.daemons.supervisor._GRACE_S", 0.2)
    pid = tmp_path / "pid"

    def stop():
        until(lambda: pid.exists() and pid.read_text())
        os.kill(os.getpid(), signal.SIGTERM)

    stopper = threading.Thread(target=stop)
    stopper.start()
    assert Supervisor([ProcessSpec("x", ())]).run() == 0
    stopper.join()
    assert not Path("/proc", pid.read_text().strip()).exists()
    assert "killed" in capsys.readouterr().out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_handlers_are_put_back(number):
    before = signal.getsignal(number)
    Supervisor([ProcessSpec("x", ("no-such-command",))]).run()
    assert signal.getsignal(number) is before


def test_a_package_of_our_name_in_the_working_directory_is_not_run(tmp_path, monkeypatch):
    (tmp_path / "denseface").mkdir()
    (tmp_path / "denseface" / "__init__.py").write_text("raise SystemExit('not ours')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(f"{_WATCHED}._STORM_RESTARTS", 0)
    assert Supervisor([ProcessSpec("x", ("no-such-command",))]).run() == 2


HANGS = "say(b'i'); looks_on(); kill(signal.SIGSTOP)"
DIES_AT_WORK = "say(b'i'); say(b'h'); kill(signal.SIGKILL)"
DIES = "say(b'h'); say(b'i'); kill(signal.SIGKILL)"
ENOUGH = "os._exit(2)"


def test_what_hangs_is_killed_and_started_again(run_in_turn, capsys):
    assert run_in_turn(HANGS, "say(b'h'); looks_on(); time.sleep(600)", ENOUGH,
                       hang_timeout_s=0.4) == 2
    said = capsys.readouterr().out
    assert said.count("hangs, killed") == 2
    assert said.count("reason=hung") == 2


def test_who_says_that_it_lives_is_left_alone(run_in_turn):
    lives = f"for _ in range(60):\n say(b'i'); look(); time.sleep(0.02)\n{ENOUGH}"
    assert run_in_turn(lives, "os._exit(3)", hang_timeout_s=0.4) == 2


def test_death_at_work_is_no_storm(run_in_turn, monkeypatch):
    monkeypatch.setattr(f"{_WATCHED}._STORM_RESTARTS", 0)
    assert run_in_turn(*[DIES_AT_WORK] * 4, ENOUGH) == 2


def test_death_after_work_is_one(run_in_turn, monkeypatch):
    monkeypatch.setattr(f"{_WATCHED}._STORM_RESTARTS", 1)
    assert run_in_turn(DIES, DIES, ENOUGH) == 1


@pytest.fixture
def starting(monkeypatch):
    """Give a process that has said nothing yet, and the processor time that it has used."""
    used = [0]
    monkeypatch.setattr(f"{_WATCHED}._processor_ticks", lambda _: used[0])
    monkeypatch.setattr(f"{_WATCHED}.sys.executable", "/bin/true")
    process = WatchedProcess(ProcessSpec("x", ()))
    process.start(attended=5.0)
    yield process, used
    if process.running:
        until(process.ended)


def test_who_does_something_may_take_long_to_start(starting):
    process, used = starting
    for now in range(5, 606, 30):
        used[0] += 1
        assert process.kill_if_hung(now, limit_s=30.0) == 0.0
    assert process.kill_if_hung(606.0, limit_s=1000.0) == 0.0
    assert process.kill_if_hung(606.0, limit_s=30.0) == 601.0
    assert process.kill_if_hung(9999.0, limit_s=30.0) == 0.0  # it was killed already
    process.running.wait(LIMIT_S)
    end = process.ended()
    assert (end.reason, end.holding, process.counts) == ("hung", False, {"hung": 1})
    assert process.last_end == "it hung"


def test_how_a_process_ended_is_kept_with_what_it_said(starting):
    process, _ = starting
    until(lambda: process.running.poll() is not None)
    process._link.why = "no such class"
    process.ended()
    assert process.last_end == "status 0: no such class"
    assert [_ending(status, "", hung=False) for status in (1, -11, -64, -99)] == [
        "status 1", "SIGSEGV", "SIGRTMAX", "signal 99"]


def test_who_does_nothing_hangs_from_the_start(starting):
    process, used = starting
    used[0] = 7
    assert process.kill_if_hung(10.0, limit_s=30.0) == 0.0
    assert process.kill_if_hung(40.0, limit_s=30.0) == 0.0
    assert process.kill_if_hung(41.0, limit_s=30.0) == 31.0


def test_what_is_stopped_before_its_first_word_is_replaced(run_in_turn, capsys):
    assert run_in_turn("looks_on(); kill(signal.SIGSTOP)", ENOUGH, hang_timeout_s=0.4) == 2
    assert "hangs, killed" in capsys.readouterr().out


def test_what_cannot_be_started_is_tried_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(f"{_WATCHED}.sys.executable", str(tmp_path / "missing"))
    monkeypatch.setattr(f"{_WATCHED}._BACKOFF_S", 0.0)
    assert Supervisor([ProcessSpec("x", ())]).run() == 1
    assert capsys.readouterr().out.count("cannot be started") == 6


def test_an_owner_that_was_away_blames_nobody_for_it():
    times = iter([100.0, 100.5, 101.0, 4000.0, 4000.5])
    clock = AttendedClock(1.0, lambda: next(times))
    assert [clock.look() for _ in range(4)] == [0.5, 1.0, 2.0, 2.5]
