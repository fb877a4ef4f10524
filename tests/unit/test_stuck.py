"""A test that its time-out does not end costs its process, not the whole run."""

import subprocess
import sys

import pytest

from tests.waiting import LIMIT_S

_IN_A_THREAD_OF_ITS_OWN = """
def test_that_waits():
    with ThreadPoolExecutor() as pool:
        pool.submit(threading.Event().wait).result()
"""
_IN_WHAT_IS_UNDONE = """
@pytest.fixture
def ever():
    yield
    ThreadPoolExecutor().submit(threading.Event().wait).result()

def test_that_waits(ever):
    raise ValueError
"""
_WITH_THE_INTERPRETER_LOCKED = """
def test_that_waits():
    mutex = ctypes.create_string_buffer(64)
    for _ in range(2):
        ctypes.PyDLL(None).pthread_mutex_lock(mutex)
"""
_PYTEST = """
import sys, pytest, tests.stuck
tests.stuck.MORE_S = 0.2
sys.exit(pytest.main(["-q", "-p", "tests.stuck", "-p", "no:cacheprovider", "--timeout=0.2",
                      "--rootdir", sys.argv[1], sys.argv[1]]))
"""


@pytest.mark.parametrize(
    "test", [_IN_A_THREAD_OF_ITS_OWN, _IN_WHAT_IS_UNDONE, _WITH_THE_INTERPRETER_LOCKED],
    ids=["in a thread", "in what is undone", "in C"])
def test_whatever_waits_for_ever_is_ended_and_where_is_said(tmp_path, test):
    (tmp_path / "test_of_others.py").write_text(
        "import ctypes, threading, pytest\n"
        "from concurrent.futures import ThreadPoolExecutor\n" + test)
    ended = subprocess.run([sys.executable, "-c", _PYTEST, tmp_path], capture_output=True,
                           text=True, timeout=LIMIT_S, check=False)
    assert ended.returncode == 1
    assert "passed" not in ended.stdout
    assert "test_of_others.py" in ended.stderr
    assert "Timeout (" in ended.stderr


def test_who_ends_in_time_is_left_alone(tmp_path):
    (tmp_path / "test_of_others.py").write_text("def test_that_ends(): pass")
    ended = subprocess.run([sys.executable, "-c", _PYTEST, tmp_path], capture_output=True,
                           text=True, timeout=LIMIT_S, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
