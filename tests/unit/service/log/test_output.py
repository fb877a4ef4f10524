"""Where the log goes: files, pipes, whoever reads them, and what becomes of the lines."""

import fcntl
import os
import resource
import threading

import pytest

from denseface.service.log import output
from denseface.service.log.output import LogOutput, LogStream
from tests.waiting import LIMIT_S, until

PIPE_BYTES = 4096


@pytest.fixture
def pipe():
    """Gives a small pipe that is full."""
    reader, writer = os.pipe()
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    os.write(writer, b"." * PIPE_BYTES)
    yield reader, writer
    os.close(reader)


@pytest.fixture
def file(tmp_path):
    descriptor = os.open(tmp_path / "log", os.O_RDWR | os.O_CREAT | os.O_APPEND)
    yield descriptor
    os.close(descriptor)


def read_all(descriptor):
    return os.pread(descriptor, 2**20, 0).decode()


def noting(log):
    """Have a log say what it lost."""
    log.on_recovery = lambda lines, total: log.put(f"lost {lines} of {total}")
    return log


def test_lines_are_written_in_their_order(file):
    log = LogOutput(file)
    for number in range(100):
        log.put(f"{number} \udc80")
    log.flush(LIMIT_S)
    assert read_all(file) == "".join(f"{number} \\udc80\n" for number in range(100))
    assert log.lost == 0


@pytest.mark.parametrize("path", ["/dev/full", os.devnull])
def test_lines_that_cannot_be_written_are_counted_and_said_later(path, file):
    broken = os.open(path, os.O_RDWR if path == "/dev/full" else os.O_RDONLY)
    kept = os.dup(file)
    os.dup2(broken, file)
    log = noting(LogOutput(file))
    for _ in range(3):
        log.put("x")
    log.flush(LIMIT_S)
    assert log.lost == 3
    os.dup2(kept, file)
    log.put("y")
    until(lambda: read_all(file) == "y\nlost 3 of 3\n")
    os.dup2(broken, file)
    log.put("x")
    log.flush(LIMIT_S)
    os.dup2(kept, file)
    log.put("z")
    until(lambda: read_all(file) == "y\nlost 3 of 3\nz\nlost 1 of 4\n")
    os.close(broken)
    os.close(kept)


def test_nobody_waits_for_a_reader_that_has_stopped(pipe, monkeypatch):
    monkeypatch.setattr(output, "_MAX_BYTES", 100)
    reader, writer = pipe
    log = noting(LogOutput(writer))
    for number in range(1000):
        log.put(f"{number:09}")
    assert log.lost == 990
    log.flush(0.01)  # gives up
    read = b""
    while not read.endswith(b"000000009\n"):
        read += os.read(reader, PIPE_BYTES)
    assert read.lstrip(b".").startswith(b"000000000\nlost 990 of 990\n000000001\n")
    log.put("more")
    assert os.read(reader, PIPE_BYTES) == b"more\n"
    os.close(writer)


def test_a_reader_that_leaves_ends_nothing(pipe):
    reader, writer = pipe
    log = LogOutput(writer)
    log.put("x")
    os.dup2(os.open(os.devnull, os.O_RDONLY), reader)
    log.flush(LIMIT_S)
    assert log.lost == 1
    os.close(writer)


def test_a_pipe_that_another_process_made_non_blocking_is_waited_for(pipe):
    reader, writer = pipe
    os.set_blocking(writer, False)
    log = LogOutput(writer)
    log.put("x")
    read = b""
    while not read.endswith(b".x\n"):
        read += os.read(reader, 100)
    log.flush(LIMIT_S)
    assert log.lost == 0
    os.close(writer)


def test_after_a_part_of_a_line_the_next_is_a_line_of_its_own(file):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    log = LogOutput(file)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
    try:
        for line in ("12345", "67890", "abc"):
            log.put(line)
        log.flush(LIMIT_S)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    log.put("next")
    log.flush(LIMIT_S)
    assert read_all(file) == "12345\n6789\nnext\n"
    assert log.lost == 2


def test_a_child_that_was_forked_logs_too(file):
    log = LogOutput(file)
    log.put("parent")
    log.flush(LIMIT_S)
    with log._changed:
        child = os.fork()
        if child == 0:
            log.put("child")
            log.flush(LIMIT_S)
            os._exit(log.lost)
    assert os.waitpid(child, 0)[1] == 0
    assert read_all(file) == "parent\nchild\n"


def test_what_is_printed_comes_line_by_line():
    lines = []
    stream = LogStream(lines.append)
    print("a", file=stream)
    stream.write("b")
    other = threading.Thread(target=lambda: print("other", file=stream))
    other.start()
    other.join()
    stream.write("c\n\nd\ne")
    assert lines == ["a", "other", "bc", "d"]
    stream.write("f" * 20000)
    assert lines[-1] == "e" + "f" * 20000
