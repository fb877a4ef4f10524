"""The command line, without a service."""

import io
import os
import pty
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import structlog

import denseface
from denseface.capture.npz import save_frame
from denseface.service.cli import _main, main
from denseface.service.log.output import process_log
from tests.unit.frames import calibration, frame
from tests.waiting import LIMIT_S


@pytest.fixture
def room(tmp_path):
    """A frame with depth and without a face."""
    path = tmp_path / "room.npz"
    save_frame(frame(
        np.full((120, 160), 900, np.uint16), np.full((120, 160, 3), 90, np.uint8), calibration()),
        path)
    return path


@pytest.fixture(autouse=True)
def _stderr(monkeypatch):
    """Undo what a daemon's log does to this process."""
    monkeypatch.setattr(sys, "stderr", sys.stderr)
    yield
    structlog.reset_defaults()


def outcome(capfd, *arguments):
    try:
        status = main([str(one) for one in arguments])
    except SystemExit as exit_:
        status = exit_.code
    process_log.flush(LIMIT_S)
    return status, capfd.readouterr().err


@pytest.mark.parametrize(("arguments", "message"), [
    (["fly"], "unknown command 'fly', expected reconstruct, "),
    (["reconstruct"], "expected INPUT or --depth, found neither"),
    (["reconstruct", "{tmp}/no.npz"], "no.npz"),
    (["reconstruct", "{tmp}/no.oni"], "no.oni"),
    (["reconstruct", "{tmp}/garbage.npz"], "garbage.npz"),
    (["reconstruct", "{tmp}/garbage.oni"], "garbage.oni"),
    (["reconstruct", "{tmp}/garbage.xyz"], "garbage.xyz"),
    (["reconstruct", "{tmp}/room.npz", "--frame", "1"], "1 frames (0 to 0), --frame asks for 1"),
    (["reconstruct", "{tmp}/room.npz", "--frame", "-1"],
     "--frame: expected a whole number, at least 0, found '-1'"),
    (["reconstruct", "{tmp}/room.npz", "-o", "face.xyz"], ".ply .pcd .npz .obj .glb .stl"),
    (["reconstruct", "{tmp}/room.npz", "-o", "{tmp}/hub/faces/face.ply"], "a hub's data folder"),
    (["reconstruct", "{tmp}/room.npz", "--report", "{tmp}/hub/r.json"], "a hub's data folder"),
    (["reconstruct", "{tmp}/room.npz", "--report", "r.txt"], "ends in .json"),
    (["reconstruct", "{tmp}/room.npz", "--preview", "p.jpg"], "ends in .png"),
    (["reconstruct", "{tmp}/room.npz", "--preset", "fast"], "--preset: "),
    (["reconstruct", "{tmp}/room.npz", "--set", "speed=9"], "--set speed=9: expected NAME=VALUE"),
    (["reconstruct", "{tmp}/room.npz", "--set", "ratio"], "--set ratio: expected NAME=VALUE"),
    (["reconstruct", "{tmp}/room.npz", "--set", "ratio=many"], "--set ratio: "),
    (["reconstruct", "{tmp}/room.npz", "--calibration", "{tmp}/no.json"], "no.json"),
    (["reconstruct", "openni2:"], "expected a .npz or .oni file"),
    (["live", "--frames", "0"], "expected a whole number"),
    (["live", "--seconds", "0"], "expected seconds"),
    (["live", "--seconds", "1", "--frames", "1"], "not allowed with"),
    (["live", "--source", "{tmp}/no.oni"], "no.oni"),
    (["live", "--source", "{tmp}/room.npz", "--preset", "fast"], "--preset: "),
    (["up", "--workers", "0"], "--workers: expected a whole number from 1 to 256, found '0'"),
    (["up", "--address", "tcp://0.0.0.0:5000", "--data", "{tmp}/data"], "CURVE"),
    (["up", "--listen", "tcp://0.0.0.0:5000", "--keys", "{tmp}/keys"], "`denseface keys new hub`"),
    (["up", "--listen", "ipc:///run/hub", "--keys", "{tmp}/keys"], "--listen expects tcp://"),
    (["status", "--hub", "tcp://10.0.0.1:5", "--key", "{tmp}/no"], "expected --hub-key FILE"),
    (["status", "--hub", "tcp://10.0.0.1:5", "--key", "{tmp}/no", "--hub-key", "{tmp}/no"], "no: "),
    (["worker", "--hub", "nowhere"], "expected ipc://PATH or tcp://HOST:PORT"),
    (["worker", "--hub", "tcp://10.0.0.1:5", "--hub-key", "{tmp}/no"], "expected --key FILE"),
    (["keys", "new", "../hub", "--keys", "{tmp}/keys"], "key name '../hub'"),
    (["keys", "allow", "a", "b"], "required: ROLE"),
    (["keys", "allow", "a", "b", "king"],
     "ROLE: expected sensor, worker, presser, subscriber or operator, found 'king'"),
    (["press", "--timeout", "never"], "expected seconds"),
    (["press", "--id", "../x", "--address", "ipc:///tmp/none/hub"], "capture id '../x'"),
    (["press", "--address", "nowhere"], "expected ipc://PATH or tcp://HOST:PORT"),
    (["press", "--save", "face"], "ending missing"),
    (["press", "--gate", "maybe"], "--gate: expected off, wait, refuse or best, found 'maybe'"),
    (["press", "--frames", "33", "--address", "ipc:///tmp/none/hub"], "frames: "),
    (["press", "--sensor", "a b", "--address", "ipc:///tmp/none/hub"], "sensor: "),
    (["subscribe", "--hints", "--last", "3"], "not allowed with"),
    (["subscribe", "--hints", "--save", "{tmp}"], "--save: expected without --hints"),
    (["subscribe", "--sensor", "s"], "--sensor: expected with --hints"),
    (["up", "--source", "a.oni", "--source", "a.oni"], "--source a.oni: given twice"),
    (["up", "--source", "a.oni", "--source", "b.oni", "--calibration", "c.json"],
     "--calibration: 1 given for 2 sources"),
    (["up", "--source", "a.oni", *2 * ("--rotate", "90")], "--rotate: 2 given for 1 sources"),
    (["up", "--rotate", "45"], "--rotate: expected 0, 90, 180 or 270, found '45'"),
    (["press", "--save", "{tmp}/hub/face.ply"], "never removed, whatever the retention: name a"),
    (["subscribe", "--save", "{tmp}/hub/faces"], "a hub's data folder"),
    (["subscribe", "--format", "glb"], "--format: expected with --save"),
    (["subscribe", "--save", "{tmp}", "--format", "xyz"], "--format: expected "),
    (["press", "--mode", "688"], "expected three octal digits such as 640, the"),
    (["subscribe", "--mode", "040"], "the first a 6 or 7, found '040'"),
    (["subscribe", "--count", "0"], "--count: expected a whole number, at least 1, found '0'"),
    (["subscribe", "--last", "0"], "--last: expected a whole number, at least 1, found '0'"),
    (["subscribe", "--last", "1", "--after", "1"], "not allowed with"),
    (["subscribe", "--since", "noon"], "UTC or with a zone, found 'noon'"),
    (["hub", "--retention", "0"], "--retention: "),
    (["hub", "--metrics", "0.0.0.0:9400"], "this machine alone"),
    (["up", "--metrics", "http"], "--metrics: "),
    (["up", "--retention", "soon"], "24h, 90m or 7d, or off"),
    (["dead", "retry"], "expected ids, or --all"),
    (["dead", "drop", "a", "--all"], "expected ids, or --all"),
    (["dead", "drop", "../x"], "capture id '../x'"),
    (["purge", "--yes"], "required"),
    (["purge", "--all", "--id", "a"], "not allowed with"),
    (["purge", "--before", "noon"], "UTC or with a zone, found 'noon'"),
    (["purge", "--id", "../x", "--yes"], "capture id '../x'"),
    (["purge", "--all"], "--yes: expected"),
])
def test_wrong_usage_is_one_line_and_status_2(room, capfd, arguments, message):
    for name in ("garbage.npz", "garbage.oni", "garbage.xyz"):
        (room.parent / name).write_bytes(b"garbage" * 100)
    for name in ("frames", "faces", "quarantine", "lock"):
        (room.parent / "hub" / name).mkdir(parents=True)
    status, text = outcome(capfd, *[one.replace("{tmp}", str(room.parent)) for one in arguments])
    assert (status, len(text.splitlines())) == (2, 1)
    assert message in text


def test_an_untried_python_is_said_once(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(
        "denseface.service.cli._main.untried_python", lambda: "Python 3.15.0 is newer")
    line = "denseface: Python 3.15.0 is newer"
    assert main(["reconstruct", f"{tmp_path}/none.oni"]) == 2
    assert capfd.readouterr().err.splitlines()[0] == line
    monkeypatch.setenv("DENSEFACE_PARENT", "1")
    assert main(["reconstruct", f"{tmp_path}/none.oni"]) == 2
    assert line not in capfd.readouterr().err


def test_an_installation_without_a_part_is_one_line_and_status_2(room, monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "denseface.recon.pipeline", None)
    monkeypatch.setattr("denseface.service.commands.reconstruct.run", lambda _: (
        __import__("denseface.recon.pipeline")))
    status, text = outcome(capfd, "reconstruct", room)
    assert status == 2
    assert text.endswith(
        f"; the installation in {sys.prefix} is incomplete: install denseface again\n")
    assert text.count("\n") == 1


def test_a_frame_without_a_face_is_one_line_and_status_1(room, tmp_path, capfd):
    status, text = outcome(capfd, "reconstruct", room, "-o", tmp_path / "face.ply")
    assert (status, len(text.splitlines())) == (1, 1)
    assert "face" in text
    assert not (tmp_path / "face.ply").exists()


@pytest.mark.parametrize(("command", "extra"), [("reconstruct", "worker"), ("capture", "capture"),
                                                ("up", "all")])
def test_a_missing_package_is_one_line_that_names_the_extra(monkeypatch, capfd, command, extra):
    def run(_):
        raise ModuleNotFoundError("No module named 'numba'", name="numba.core")

    monkeypatch.setattr(_main, "load", lambda _: SimpleNamespace(run=run))
    assert outcome(capfd, command, *["x.npz"][:command == "reconstruct"]) == (
        2, f"denseface {command}: numba is not installed: pip install 'denseface-core[{extra}]' "
           "brings what is needed here\n")


def test_the_version_and_those_of_what_it_rests_on(capsys):
    for more, least in (([], 1), (["--verbose"], 8)):
        with pytest.raises(SystemExit) as ended:
            main(["--version", *more])
        assert not ended.value.code
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == denseface.__version__
        assert len(lines) == 1 if least == 1 else len(lines) >= least
    assert f"numpy {np.__version__}" in lines
    assert any(line.startswith("Python 3.") for line in lines)


def test_debug_shows_the_traceback(tmp_path):
    with pytest.raises(OSError, match=r"no\.npz"):
        main(["reconstruct", str(tmp_path / "no.npz"), "--debug"])


def test_a_traceback_obeys_no_terminal(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "denseface", "reconstruct", tmp_path / "\x1b[2J.npz", "--debug"],
        capture_output=True, text=True, check=False, timeout=LIMIT_S)
    assert done.returncode == 1
    assert r"\x1b[2J.npz" in done.stderr
    assert all(line.isprintable() for line in done.stderr.split("\n"))


def test_ctrl_c_is_status_130(room, monkeypatch, capfd):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("denseface.service.tools.reconstruction.single.reconstruct", interrupted)
    assert outcome(capfd, "reconstruct", room) == (130, "")


@pytest.mark.parametrize(("typed", "status"), [(b"\x04", 1), (b"\n", 1), (b"n\n", 1), (b"y\n", 2)])
def test_a_question_at_a_terminal_is_answered_by_yes_alone(monkeypatch, capfd, typed, status):
    ours, theirs = pty.openpty()
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        os.write(ours, typed)  # Ctrl-D first
        purge = ["purge", "--all", "--address", "ipc:///dev/null/no-hub"]
        assert main(purge) == status
    os.close(ours)
    out, said = capfd.readouterr()
    assert said.startswith("Remove all captures, with frame, face and report? [y/N] ")
    assert out == ("nothing removed\n" if status == 1 else "")
    assert "EOFError" not in said


def test_help_imports_nothing_heavy():
    code = ("import sys, denseface.service.cli\n"
            "try: denseface.service.cli.main(['--help'])\n"
            "except SystemExit: pass\n"
            "heavy = {'numpy', 'cv2', 'open3d', 'zmq', 'pydantic', 'scipy', 'structlog',\n"
            "         'denseface.service.commands.press'}\n"
            "sys.exit(repr(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "reconstruct" in done.stdout


def test_a_reader_that_leaves_is_no_error():
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-c", "import sys\nfrom denseface.service import cli\n"
         "from denseface.service.commands import status\n"
         "status.run = lambda args: print('x' * 100000) or 0\n"
         "sys.exit(cli.main(['status']))"],
        stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, "")


def test_a_command_that_ended_leaves_in_order_and_takes_no_module_apart():
    done = subprocess.run(
        [sys.executable, "-c", "import atexit, os, sys\nfrom denseface.__main__ import run\n"
         "from denseface.service.commands import status\n"
         "class Module:\n    def __del__(self, say=os.write): say(1, b'apart')\n"
         "module = Module()\n"
         "status.run = lambda args: bool(atexit.register(print, 'left')) + 2\n"
         "sys.exit(run())", "status"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (3, "left\n", "")


@pytest.mark.parametrize(("stderr", "prefix"), [("/dev/full", ""), (os.devnull, " 2>&-")])
@pytest.mark.parametrize(("command", "status"), [
    ("status --address tcp://127.0.0.1:1 --wait 0.01", 1), ("status --wait never", 2)])
def test_an_error_that_cannot_be_said_has_its_status(stderr, prefix, command, status):
    with Path(stderr).open("w") as unwritable:
        done = subprocess.run(
            ["sh", "-c", f'exec "$0" -m denseface {command}{prefix}', sys.executable],
            stdout=subprocess.PIPE, stderr=unwritable, text=True, check=False, timeout=LIMIT_S)
    assert (done.returncode, done.stdout) == (status, "")


def test_a_pipe_that_broke_elsewhere_is_an_error(monkeypatch, capfd):
    def broken(_):
        raise BrokenPipeError("somebody left")

    monkeypatch.setattr("denseface.service.commands.status.run", broken)
    assert outcome(capfd, "status") == (1, "denseface status: somebody left\n")


@pytest.mark.parametrize("arguments", [
    ["--version"], ["--help"], ["keys", "new", "a", "--keys", "{tmp}/keys"]])
def test_stdout_on_a_full_disk_is_one_line_and_status_1(arguments, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(_main, "discard_unless_flushed", lambda _: None)  # it is pytest's own
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main([one.replace("{tmp}", str(tmp_path)) for one in arguments]) == 1
        monkeypatch.setattr(sys, "stdout", io.StringIO())
        with suppress(OSError):
            full.close()
    command = "" if arguments[0].startswith("-") else " keys"
    assert capsys.readouterr().err == f"denseface{command}: stdout: No space left on device\n"


def test_a_file_name_in_an_error_obeys_no_terminal(tmp_path, capfd):
    status, text = outcome(capfd, "reconstruct", tmp_path / "\x1b[31m\u202e.npz")
    assert (status, len(text.splitlines())) == (2, 1)
    assert text.rstrip("\n").isprintable()
    assert r"\x1b[31m\u202e.npz" in text


def test_a_sigterm_while_the_interpreter_ends_leaves_no_traceback():
    code = ("import atexit, os, signal, sys\nfrom denseface.service.cli import main\n"
            "atexit.register(os.kill, os.getpid(), signal.SIGTERM)\n"
            "sys.exit(main(['status', '--address', 'ipc:///tmp/none/hub', '--wait', '0.01']))\n")
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT_S, check=False,
        env=os.environ | {"PYTHONPATH": ":".join(sys.path)})
    assert ended.returncode == -signal.SIGTERM
    assert "Traceback" not in ended.stderr
