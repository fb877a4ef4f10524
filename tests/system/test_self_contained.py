"""The repository needs nothing from beside it, and says nothing of where it was made."""

import os
import re
import subprocess
import sys

import pytest

from tests.simulator.landmarks import SCANS
from tests.system.running import REPOSITORY
from tests.waiting import LIMIT_S, PATIENCE

_NEEDING_A_HEAD = "tests/unit/simulator/test_heads.py"
"""Those of `tests/unit/recon/test_pipeline.py` are always without the folder."""
_UNWANTED = {
    "a path of one machine": re.compile(rb"(?<![\w.])/(?:home|work|root|Users)/\w"),
    # Who tests that pickles are refused has to write one.
    "a pickle read": re.compile(rb"(?m)pickle\.load|^(?!.*savez).*allow_pickle\s*=\s*True"),
}


@pytest.mark.timeout(400)
def test_heads_need_no_shared_folder(tmp_path):
    # Without what a parallel run tells its workers: this is a run of its own.
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", _NEEDING_A_HEAD],
        cwd=REPOSITORY, env=kept | {"DENSEFACE_SHARED": str(tmp_path)}, check=False,
        capture_output=True, text=True, timeout=390 * PATIENCE)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert re.search(r"\d+ passed", done.stdout)
    assert "skipped" not in done.stdout


def test_who_has_a_scanned_head_asks_whether_it_is_at_hand():
    tests = {path.relative_to(REPOSITORY): path.read_text()
             for folder in ("unit", "system")
             for path in (REPOSITORY / "tests" / folder).rglob("*.py")}
    naming = {path for path, text in tests.items() if any(f'"{scan}' in text for scan in SCANS)}
    assert naming
    assert {path for path in naming if "head_names()" not in tests[path]} == set()


@pytest.fixture(scope="module")
def committed():
    """Every committed file that is still there."""
    try:
        done = subprocess.run(["git", "ls-files", "-z"], cwd=REPOSITORY, check=False,
                              capture_output=True, timeout=LIMIT_S)
    except FileNotFoundError:
        pytest.skip("git is not installed")
    if done.returncode:
        pytest.skip("not a git repository")
    paths = [REPOSITORY / name.decode() for name in done.stdout.split(b"\0") if name]
    return [path for path in paths if path.is_file()]


def test_the_committed_files_are_all_seen(committed):
    assert REPOSITORY / "pyproject.toml" in committed


@pytest.mark.parametrize("what", list(_UNWANTED))
def test_no_committed_file_holds(what, committed):
    found = {str(path.relative_to(REPOSITORY)): hit.group()
             for path in committed if (hit := _UNWANTED[what].search(path.read_bytes()))}
    assert not found
