"""What script/bootstrap says while it works and where it fails, with a pip that only talks."""

import os
import shutil
import signal
import subprocess

import pytest

from tests.system.running import REPOSITORY
from tests.waiting import LIMIT_S, until

_PYTHON = """#!/bin/sh
case $* in
'-m venv .venv')
    mkdir -p .venv/bin
    cp "$0" .venv/bin/python
    ;;
*' -m pip install '*requirements/build.txt | '-m pip install '*requirements/build.txt)
    cat {said}
    touch {reached}
    {then}
    ;;
esac
"""
_NO_NETWORK = """\
WARNING: Retrying (Retry(total=0)) after connection broken by 'NewConnectionError("HTTPSConnection(\
host='pypi.org', port=443): Failed to establish a new connection: [Errno -2] \
Name or service not known")': /simple/hatchling/
ERROR: Could not find a version that satisfies the requirement hatchling==1.33.0 (from versions: \
none)
ERROR: No matching distribution found for hatchling==1.33.0
"""
_FULL = "ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device\n"


@pytest.fixture
def bootstrap(tmp_path):
    """Give a checkout in which pip says something and then does something."""
    checkout = tmp_path / "checkout"
    shutil.copytree(REPOSITORY / "requirements", checkout / "requirements")
    (checkout / "script").mkdir()
    (checkout / "whole").mkdir()
    for name in ("script/bootstrap", "pyproject.toml"):
        shutil.copy(REPOSITORY / name, checkout / name)
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "dpkg-query").write_text("#!/bin/sh\necho ' installed '\n")

    def start(said, then):
        (tmp_path / "said").write_text(said)
        (tools / "python3").write_text(_PYTHON.format(
            said=tmp_path / "said", reached=tmp_path / "reached", then=then))
        for tool in tools.iterdir():
            tool.chmod(0o700)
        return subprocess.Popen(
            [checkout / "script" / "bootstrap"], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, process_group=0,
            env={"PATH": f"{tools}:/usr/bin:/bin", "TMPDIR": str(tmp_path)})

    return start


@pytest.mark.parametrize(("said", "line"), [
    (_NO_NETWORK, "the network failed (pypi.org: Name or service not known); run "
                  "script/bootstrap again when it is back"),
    (_FULL, "the disk is full: "),
])
def test_a_failure_whose_cause_is_known_is_one_line(bootstrap, said, line):
    process = bootstrap(said, "exit 1")
    out, error = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1
    assert "up to 380 MB to download" in out
    assert error.count("\n") == 1
    assert error.startswith(f"bootstrap: {line}")


def test_of_another_failure_the_end_of_what_was_said_is_shown_and_all_kept(bootstrap, tmp_path):
    process = bootstrap("".join(f"word {number}\n" for number in range(40)), "exit 1")
    *shown, last = process.communicate(timeout=LIMIT_S)[1].splitlines()
    assert shown == [f"word {number}" for number in range(15, 40)]
    kept = last.removeprefix("bootstrap: failed; all of what was said is in ")
    assert (tmp_path / kept).read_text().startswith("word 0\n")


def test_steps_that_end_at_once_end():
    """The child that says how far a step is may not outlive it, however new it is."""
    functions = (REPOSITORY / "script" / "bootstrap").read_text().split("\n# End with one line")[0]
    ended = subprocess.run(
        ["sh"], text=True, capture_output=True, timeout=LIMIT_S, cwd=REPOSITORY,
        input=f"cd script\n{functions.replace('$0', '$PWD/bootstrap')}\n"
              "for step in $(seq 300); do work say true; done; say ended\n")
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "bootstrap: ended\n", "")


def test_ctrl_c_is_status_130_and_leaves_nothing_that_counts_as_installed(bootstrap, tmp_path):
    process = bootstrap("", "exec sleep 600")
    until(lambda: (tmp_path / "reached").exists())
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate(timeout=LIMIT_S)[1] == (
        "bootstrap: stopped; the next run goes on from here\n")
    assert process.returncode == 130
    assert not (tmp_path / "checkout" / ".venv" / "installed").exists()
