"""Failpoints: off by default, named, each once where there are tokens."""

import ast
import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from denseface.service.errors import SettingsError
from denseface.service.runtime import failpoints
from denseface.service.runtime.failpoints import (
    FAILPOINT_NAMES,
    FAILPOINTS_VARIABLE,
    REMOVAL_FAILPOINTS,
    TOKENS_VARIABLE,
    arm,
    failpoint,
)
from tests.waiting import LIMIT_S

SERVICE = Path(failpoints.__file__).parents[1]


@pytest.fixture(autouse=True)
def off():
    yield
    arm({})


def outcome(name: str) -> str | None:
    try:
        failpoint(name)
    except OSError as error:
        return errno.errorcode[error.errno]
    return None


def test_nothing_happens_where_nothing_is_set():
    arm({})
    assert [outcome(name) for name in FAILPOINT_NAMES] == [None] * len(FAILPOINT_NAMES)


def test_an_error_each_time_or_at_one_time_only():
    arm({FAILPOINTS_VARIABLE: "hub.frame.synced=raise:ENOSPC,hub.face.written=raise:EIO@2"})
    assert [outcome("hub.frame.synced") for _ in range(3)] == ["ENOSPC"] * 3
    assert [outcome("hub.face.written") for _ in range(3)] == [None, "EIO", None]
    assert outcome("hub.frame.written") is None


def test_with_tokens_each_token_is_good_for_one_failure(tmp_path):
    arm({FAILPOINTS_VARIABLE: "hub.frame.synced=raise:ENOSPC", TOKENS_VARIABLE: str(tmp_path)})
    assert outcome("hub.frame.synced") is None
    (tmp_path / "hub.frame.synced").touch()
    assert [outcome("hub.frame.synced") for _ in range(2)] == ["ENOSPC", None]
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "hub.frame.synced").write_bytes(b".")  # for one time more
    assert [outcome("hub.frame.synced") for _ in range(3)] == ["ENOSPC", "ENOSPC", None]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("text", "named"), [
    ("hub.nowhere=kill", "no failpoint 'hub.nowhere'"),
    ("hub.job.sent", "cannot ''"),
    ("hub.job.sent=explode", "cannot 'explode'"),
    ("hub.job.sent=raise:EIO", "cannot 'raise:EIO'"),
    ("hub.frame.synced=raise:EPERM", "cannot 'raise:EPERM'"),
    ("hub.job.sent=kill@0", "number from 1"),
    ("hub.job.sent=kill@x", "number from 1"),
    ("hub.job.sent=kill,", "no failpoint ''"),
])
def test_what_is_unknown_is_refused_in_one_line(text, named):
    with pytest.raises(SettingsError, match=named) as refused:
        arm({FAILPOINTS_VARIABLE: text})
    assert FAILPOINTS_VARIABLE in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("action", "number"), [("kill", signal.SIGKILL), ("stop", signal.SIGSTOP)])
def test_a_process_ends_or_stops_at_the_third_time(action, number):
    code = ("import os\nfrom denseface.service.runtime.failpoints import arm, failpoint\n"
            "from denseface.service.log.events import configure\n"
            "from denseface.service.log.output import process_log\n"
            "configure('text', 'test')\narm(os.environ)\nprocess_log.flush()\n"
            "for time in range(4):\n print(time, flush=True)\n failpoint('hub.job.sent')\n")
    with subprocess.Popen(
            [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, env={FAILPOINTS_VARIABLE: f"hub.job.sent={action}@3",
                            "PYTHONPATH": ":".join(sys.path)},
    ) as process:
        said = [process.stdout.readline() for _ in range(3)]
        if action == "stop":
            os.waitid(os.P_PID, process.pid, os.WSTOPPED)
            process.send_signal(signal.SIGCONT)
            assert process.wait(LIMIT_S) == 0
            said.append(process.stdout.readline())
        else:
            assert process.wait(LIMIT_S) == -number
        assert said == [f"{time}\n" for time in range(4 if action == "stop" else 3)]
        assert "failpoints are set" in process.stderr.read()


def test_every_failpoint_is_somewhere_and_none_else():
    found: set[str] = set()
    for path in SERVICE.rglob("*.py"):
        if path.name != "failpoints.py":
            found.update(one.value for one in ast.walk(ast.parse(path.read_text()))
                         if isinstance(one, ast.Constant) and isinstance(one.value, str)
                         and one.value.startswith(("hub.", "worker.", "capture."))
                         and one.value.count(".") == 2)
    of_files = {f"{steps}.{step}" for steps in ("hub.frame", "hub.face")
             for step in ("written", "synced", "renamed", "named")}
    assert found | of_files == set(FAILPOINT_NAMES + REMOVAL_FAILPOINTS)
