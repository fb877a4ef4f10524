"""What a process asks of the kernel about itself."""

import os
import signal
import subprocess
import sys

import pytest

from denseface.service.runtime.process import untried_python

CRASH = """
import os, resource, sys
resource.setrlimit(resource.RLIMIT_CORE, (resource.getrlimit(resource.RLIMIT_CORE)[1],) * 2)
from denseface.service.cli import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
os.abort()
"""


def crash(folder, **environment):
    """Run a command that is about to print its help, and say whether its crash left a core."""
    process = subprocess.Popen([sys.executable, "-c", CRASH, "worker", "--help"], cwd=folder,
                               stdout=subprocess.DEVNULL, env=os.environ | environment)
    _, status = os.waitpid(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == -signal.SIGABRT
    return os.WCOREDUMP(status)


def test_a_crash_leaves_no_pictures_in_a_core_file(tmp_path):
    assert not crash(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_python_newer_than_those_that_were_tried_is_named():
    assert [untried_python((3, minor, 0)) for minor in (11, 14)] == ["", ""]
    assert untried_python((3, 15, 2)) == (
        "Python 3.15.2 is newer than any that denseface was tried on (3.11 to 3.14)")


def test_what_calls_the_command_may_allow_them_again():
    code = """
import resource, sys
from denseface.service.cli import main
before = resource.getrlimit(resource.RLIMIT_CORE)[1]
try:
    main(["worker", "--help"])
except SystemExit:
    pass
assert resource.getrlimit(resource.RLIMIT_CORE) == (0, before)
"""
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_core_dumps_can_be_had_to_find_a_fault(tmp_path):
    if not crash(tmp_path, DENSEFACE_CORE_DUMPS="1"):
        pytest.skip("this system makes no core dumps")
    for core in tmp_path.iterdir():
        core.unlink()
