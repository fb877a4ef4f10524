"""The process table and its supervisor."""

import os
import signal
import threading
from pathlib import Path

import pytest

from denseface.service.daemons.supervisor import ProcessSpec, Supervisor, _Process, process_table
from tests.waiting import until


def test_the_table_names_what_runs():
    table = process_table(2, ["--address=ipc:///x"], hub=["--data=d"], capture=["--source=x.oni"])
    assert [row.name for row in table] == ["hub", "capture", "worker-1", "worker-2"]
    assert table[0].arguments == ("hub", "--data=d", "--address=ipc:///x")
    assert table[1].arguments == ("capture", "--source=x.oni", "--address=ipc:///x")
    assert table[2].environment["OMP_NUM_THREADS"] == "1"


def test_restarts_come_later_and_later_until_it_is_a_storm():
    process = _Process(ProcessSpec("x", ()))
    delays, calm = [], []
    for now in range(6):
        calm.append(process.plan_restart(now))
        delays.append(process.due - now)
    assert delays == [0.5, 1, 2, 4, 8, 16]
    assert calm == [True] * 5 + [False]


def test_an_old_restart_is_forgotten():
    process = _Process(ProcessSpec("x", ()))
    assert all(process.plan_restart(now * 30.0) for now in range(20))
    assert process.due == 19 * 30 + 2


def test_wrong_usage_of_a_child_ends_all_with_status_2():
    assert Supervisor([ProcessSpec("x", ("no-such-command",))]).run() == 2


def test_a_storm_ends_all_with_status_1(monkeypatch):
    monkeypatch.setattr("denseface.service.daemons.supervisor._BACKOFF_S", 0.0)
    monkeypatch.setattr("denseface.service.daemons.supervisor._STORM_RESTARTS", 1)
    assert Supervisor([ProcessSpec("x", ("status", "--address", "ipc:///none", "--wait", "0.01"))
                       ]).run() == 1


def test_a_process_that_does_not_end_in_time_is_killed(tmp_path, monkeypatch, capsys):
    stubborn = tmp_path / "stubborn"
    stubborn.write_text("#!/bin/sh\ntrap '' TERM\necho $$ >\"$(dirname \"$0\")/pid\"\n"
                        "while :; do sleep 1; done\n")
    stubborn.chmod(0o700)
    monkeypatch.setattr("denseface.service.daemons.supervisor.sys.executable", str(stubborn))
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
    monkeypatch.setattr("denseface.service.daemons.supervisor._STORM_RESTARTS", 0)
    assert Supervisor([ProcessSpec("x", ("no-such-command",))]).run() == 2
