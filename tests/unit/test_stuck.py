"""A test that its time-out does not end costs its process, not the whole run."""

import subprocess
import sys

from tests.waiting import LIMIT_S

_HEAD = """
import ctypes, threading, pytest
from concurrent.futures import ThreadPoolExecutor
"""
_BY_A_THREAD = """
def test_that_waits():
    with ThreadPoolExecutor() as pool:
        pool.submit(threading.Event().wait)
        raise TimeoutError
"""
_IN_WHAT_IS_UNDONE = """
@pytest.fixture
def ever():
    yield
    threading.Event().wait()

def test_that_waits(ever):
    raise TimeoutError  # pytest-timeout stops its clock here
"""
_WITH_THE_INTERPRETER_LOCKED = """
def test_that_waits():
    mutex = ctypes.create_string_buffer(64)
    for _ in range(2):
        ctypes.PyDLL(None).pthread_mutex_lock(mutex)
"""
_AFTER_AN_ERROR_WITHIN_PYTEST = """
def pytest_runtest_makereport(call):
    if call.when == "call":
        raise TimeoutError
"""
_PYTEST = """
import sys, pytest, tests.stuck
tests.stuck.MORE_S = -57.0
pytest.main(["-q", "-p", "tests.stuck", "-p", "no:cacheprovider", "--timeout=60",
             "--rootdir", sys.argv[1], sys.argv[1]])
sys.exit(77)
"""
"""The time-out itself is far away: only what was added to it ends the process."""


def test_whatever_waits_for_ever_is_ended_and_where_is_said(tmp_path):
    running = []
    for number, (test, hooks) in enumerate([
            (_BY_A_THREAD, ""), (_IN_WHAT_IS_UNDONE, ""), (_WITH_THE_INTERPRETER_LOCKED, ""),
            (_IN_WHAT_IS_UNDONE, _AFTER_AN_ERROR_WITHIN_PYTEST)]):
        file = tmp_path / str(number) / "test_of_others.py"
        file.parent.mkdir()
        file.write_text(_HEAD + test)
        (file.parent / "conftest.py").write_text(_HEAD + hooks)
        running.append(subprocess.Popen(
            [sys.executable, "-c", _PYTEST, file.parent], text=True, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE))
    for process in running:
        said = process.communicate(timeout=LIMIT_S)[1]
        assert process.returncode == 1
        assert "Timeout (" in said
        assert "test_of_others.py" in said
