"""Processes that are forked from one that has imported the packages: each starts in milliseconds.

Python takes half a second to import what a hub or a reader of a sensor needs, and tests start
hundreds. What is forked here is a process as any other: its own id, files, environment and end.
Whoever tests how a process starts, or what it imports, starts one by `subprocess`.
"""

import atexit
import contextlib
import ctypes
import functools
import gc
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import IO, Any

__all__ = ["Forked", "die_with_the_parent", "run"]

_ROOT = Path(__file__).resolve().parents[1]
_PRELOADED = (
    "denseface.capture.live.sensor", "denseface.capture.npz", "denseface.capture.oni.file",
    "denseface.capture.openni2", "denseface.service.cli", "denseface.service.client",
    "denseface.service.commands.capture", "denseface.service.commands.hub",
    "denseface.service.daemons.capture", "denseface.service.daemons.hub",
    "tests.virtual_sensor.marks", "tests.virtual_sensor.recorder")
"""Nothing of these loads OpenNI2, starts a thread, or makes a ZeroMQ context."""
_READ_AT_THE_START = ("PYTHON", "OMP_", "OPENBLAS_", "MKL_", "NUMBA_", "LD_", "LANG", "LC_")
"""Environment variables whose names begin like this matter before the first line of Python."""
_PR_SET_PDEATHSIG = 1


class Forked:
    """A process, as `subprocess.Popen` has it: as much of that as tests use.

    Parameters
    ----------
    arguments : of Python: `-c`, code, arguments; or `-m`, module, arguments
    stdin, stdout, stderr : `subprocess.PIPE` (text), or a file or descriptor; by default the
        test's own
    """

    def __init__(
        self, arguments: Sequence[object], *, env: dict[str, str] | None = None,
        cwd: Path | str | None = None, stdin: int | IO[Any] | None = None,
        stdout: int | IO[Any] | None = None, stderr: int | IO[Any] | None = None,
    ) -> None:
        self.args = [*map(str, arguments)]
        self.returncode: int | None = None
        self.stdin: IO[str] | None = None
        self.stdout: IO[str] | None = None
        self.stderr: IO[str] | None = None
        self._known = threading.Lock()
        environment = dict(os.environ if env is None else env)
        _refuse_what_comes_too_late(environment)
        with contextlib.ExitStack() as theirs:
            files = []
            for number, (name, wanted) in enumerate(
                    (("stdin", stdin), ("stdout", stdout), ("stderr", stderr))):
                if wanted == subprocess.PIPE:
                    ends = os.pipe()
                    mine, other = ends[::-1] if name == "stdin" else ends
                    setattr(self, name, os.fdopen(mine, "w" if name == "stdin" else "r"))
                    theirs.callback(os.close, other)
                    files.append(other)
                else:
                    files.append(number if wanted is None else wanted if isinstance(wanted, int)
                                 else wanted.fileno())
            self._told, answers = socket.socketpair()
            with answers:
                _nursery().fork({"arguments": self.args, "environment": environment,
                                 "cwd": str(cwd or Path.cwd())}, [*files, answers.fileno()])
        self.pid = int(self._line())

    def poll(self) -> int | None:
        """Give the status it ended with, less than 0 for a signal; None while it runs."""
        with self._known:
            if self.returncode is None and select.select([self._told], [], [], 0)[0]:
                self.returncode = os.waitstatus_to_exitcode(int(self._line()))
                self._told.close()
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end, and give the status."""
        if self.poll() is None:
            with contextlib.suppress(OSError, ValueError):  # another thread has seen the end
                select.select([self._told], [], [], timeout)
        status = self.poll()
        if status is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self) -> None:
        """Have it end in order."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def close(self) -> None:
        """End it at once, and close the pipes."""
        self.kill()
        self.wait()
        for pipe in (self.stdin, self.stdout, self.stderr):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()

    def _line(self) -> bytes:
        line = b""
        while not line.endswith(b"\n"):
            part = self._told.recv(1)
            if not part:
                raise RuntimeError("the nursery died")
            line += part
        return line


def run(
    arguments: Sequence[object], *, env: dict[str, str] | None = None,
    cwd: Path | str | None = None, timeout: float,
) -> "subprocess.CompletedProcess[str]":
    """Run a process to its end, as `subprocess.run` with its output captured as text."""
    with Path(os.devnull).open() as nothing, _Captured() as out, _Captured() as error:
        process = Forked(arguments, env=env, cwd=cwd, stdin=nothing, stdout=out.file,
                         stderr=error.file)
        try:
            status = process.wait(timeout)
        except BaseException:
            process.close()
            raise
        return subprocess.CompletedProcess(process.args, status, out.text(), error.text())


class _Captured:
    """What is written to a file without a name."""

    def __init__(self) -> None:
        self.file = os.fdopen(os.memfd_create("output"), "w+b")

    def __enter__(self) -> "_Captured":
        return self

    def __exit__(self, *_: object) -> None:
        self.file.close()

    def text(self) -> str:
        self.file.seek(0)
        return self.file.read().decode()


def _refuse_what_comes_too_late(environment: dict[str, str]) -> None:
    """Raise where a variable differs that the nursery's Python has read already."""
    for name in environment.keys() | os.environ.keys():
        if name.startswith(_READ_AT_THE_START) and name != "PYTHONPATH" and (
                environment.get(name) != os.environ.get(name)):
            raise ValueError(f"{name} is read when Python starts: use subprocess")


class _Nursery:
    """The process that forks, from the test's side."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._socket, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.nursery", str(theirs.fileno())], cwd=_ROOT,
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
        atexit.register(self.close)

    def fork(self, wanted: dict[str, Any], files: Sequence[int]) -> None:
        text = json.dumps(wanted).encode()
        with self._lock:
            socket.send_fds(self._socket, [len(text).to_bytes(4, "little")], files)
            self._socket.sendall(text)

    def close(self) -> None:
        """Let it end, and with it all that it forked."""
        self._socket.close()
        self._process.wait()


@functools.cache
def _nursery() -> _Nursery:
    return _Nursery()


# --- the nursery's own process

def _serve(given: socket.socket) -> dict[str, Any]:
    """Fork as often as asked; returns in what was forked, to be what was wanted."""
    while True:
        head, files, _, _ = socket.recv_fds(given, 4, 4)
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG) != (0, 0):
                pass
        if not head:
            os._exit(0)
        size, text = int.from_bytes(head, "little"), b""
        while len(text) < size:
            text += given.recv(size - len(text))
        if os.fork() == 0:
            given.close()
            wanted: dict[str, Any] = json.loads(text)
            _keep(wanted, files)
            return wanted
        for file in files:
            os.close(file)


def _keep(wanted: dict[str, Any], files: list[int]) -> None:
    """Fork once more, and say the process's id and its end; returns in the process itself."""
    die_with_the_parent()
    *files, answers = files
    keeper = os.getpid()
    child = os.fork()
    if child:
        for file in files:
            os.close(file)
        os.write(answers, b"%d\n" % child)
        while True:
            with contextlib.suppress(InterruptedError):
                _, status = os.waitpid(child, 0)
                break
        with contextlib.suppress(OSError):  # nobody asks any more
            os.write(answers, b"%d\n" % status)
        os._exit(0)
    die_with_the_parent()
    if os.getppid() != keeper:
        os._exit(1)
    os.close(answers)
    for target, file in enumerate(files):
        os.dup2(file, target)
    os.closerange(3, 256)
    os.chdir(wanted["cwd"])
    os.environ.clear()
    os.environ.update(wanted["environment"])
    signal.signal(signal.SIGINT, signal.default_int_handler)


def die_with_the_parent() -> None:
    """Have the kernel send SIGKILL to this process when the one that forked it is gone."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _be(wanted: dict[str, Any], at_exit: list[tuple[Any, ...]]) -> None:
    """Do what Python does with its arguments.

    Parameters
    ----------
    at_exit : functions and arguments that the modules registered
    """
    how, what, *arguments = wanted["arguments"]
    if what == "denseface":
        register = atexit.register

        def register_first(*function: Any) -> None:
            """Its own end is registered before all else is imported, and so comes last."""
            atexit.register = register
            for one in (function, *at_exit):
                register(*one)

        atexit.register = register_first  # type: ignore[assignment]
    else:
        for one in at_exit:
            atexit.register(*one)
    if how == "-m":
        sys.argv = [what, *arguments]
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    else:
        sys.argv = ["-c", *arguments]
        sys.path[0] = ""
        main = sys.modules["__main__"] = ModuleType("__main__")
        exec(compile(what, "<string>", "exec"), vars(main))  # noqa: S102


def _main() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    at_exit: list[tuple[Any, ...]] = []
    register, atexit.register = atexit.register, lambda *one: at_exit.append(one) or one[0]
    for name in _PRELOADED:
        __import__(name)
    atexit.register = register
    gc.collect()
    gc.freeze()  # else each child looks through all of it at its end, and copies it by that
    tasks = [*Path("/proc/self/task").iterdir()]
    if len(tasks) != 1:
        raise RuntimeError(f"{len(tasks)} threads: what is forked would have one of them alone")
    with socket.socket(fileno=int(sys.argv[1])) as given:
        wanted = _serve(given)
    _be(wanted, at_exit)


if __name__ == "__main__":
    _main()
