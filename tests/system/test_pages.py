"""Every command and program that a page shows is run as a reader would, a sensor plugged in."""

import os
import shutil
import signal
from pathlib import Path

import pytest

from tests.system.consoles import matches, typed_in
from tests.system.running import RECORDINGS, REPOSITORY
from tests.system.snippets import HOW_TOS, PAGES, Snippet, reader, run_all, snippets
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.process import environment, play
from tests.waiting import PATIENCE

_TIMEOUT_S = 200 * PATIENCE
"""Of all that a page shows, and of the checks of a how-to."""

pytestmark = pytest.mark.timeout(420)


@pytest.fixture(scope="module")
def sensor(tmp_path_factory):
    """Give an environment with a sensor that sees a face."""
    frames, _ = play(RECORDINGS / "frontal_700.oni")
    clip = tmp_path_factory.mktemp("clip") / "clip"
    write_clip(clip, [(frame.depth, frame.rgb) for frame in frames])
    return environment(clip)


@pytest.mark.parametrize("page", PAGES)
def test_what_a_page_shows_runs(page, sensor):
    with reader(REPOSITORY, sensor) as (desk, variables):
        done = run_all(snippets(REPOSITORY / page), desk, variables, _TIMEOUT_S)
        assert done.returncode == 0, f"{page}: {done.stderr}{done.stdout}"
        assert "Warning" not in done.stderr
    if page == "README.md":
        first = next(one for block in snippets(REPOSITORY / "docs" / "first-hour.md")
                     for one in typed_in(block.text, block.line + 1)
                     if block.language == "console" and one.command == "script/demo")
        assert matches(f"{first.shown}...\n", done.stdout), done.stdout


@pytest.mark.parametrize("page", HOW_TOS)
def test_a_how_to_does_what_it_says(page, sensor, tmp_path):
    """In a copy of the code: files are made, rows are added, and what is shown then runs."""
    copy = copied(tmp_path / "copy")
    with reader(copy, sensor) as (_, variables):
        blocks = snippets(REPOSITORY / page)
        assert any(block.language == "diff" for block in blocks), "ends in one row of a table"
        done = run_all(blocks, copy, variables | {"PYTHONPATH": str(copy)}, _TIMEOUT_S)
        assert done.returncode == 0, f"{page}: {done.stderr}{done.stdout}"


def test_what_how_tos_add_obeys_the_rules_of_the_code(tmp_path):
    """All at once: no rule is kept by an addition that it would not be kept without."""
    copy = copied(tmp_path / "copy")
    blocks = [block for page in HOW_TOS for block in snippets(REPOSITORY / page)
              if block.file or block.language == "diff"]
    assert len(blocks) > len(HOW_TOS)
    variables = os.environ | {"PYTHONPATH": str(copy)}
    with reader(copy, variables) as (_, variables):
        done = run_all(blocks, copy, variables, _TIMEOUT_S)
        assert done.returncode == 0, done.stderr
        checks = [Snippet("sh", """
            ruff check --no-cache capture recon service
            lint-imports --no-cache
            python -m pytest -q -p no:cacheprovider tests/unit/test_rooms.py
            """, 0)]
        done = run_all(checks, copy, variables, _TIMEOUT_S)
        assert done.returncode == 0, f"how-tos leave: {done.stderr}{done.stdout}"


def copied(copy: Path) -> Path:
    """Copy the code, compiled kernels too."""
    copy.mkdir()
    for name in ("capture", "recon", "service", "denseface", "tests", "docs", "script"):
        shutil.copytree(REPOSITORY / name, copy / name, symlinks=True,
                        ignore=shutil.ignore_patterns("node_modules"))
    shutil.copy(REPOSITORY / "pyproject.toml", copy)
    for name in ("README.md", "fixtures"):
        (copy / name).symlink_to(REPOSITORY / name)
    return copy


def test_a_failing_block_is_named_and_ends_what_runs(tmp_path):
    blocks = [Snippet("sh", "long() { sleep 600; }\nlong &\n", 3),
              Snippet("python", "raise SystemExit(5)\n", 8), Snippet("sh", "touch never\n", 12)]
    done = run_all(blocks, tmp_path, dict(os.environ), _TIMEOUT_S)
    assert done.returncode == 5
    lines = [line for line in done.stderr.splitlines() if line.startswith("line ")]
    assert lines == ["line 3", "line 8"]
    assert not (tmp_path / "never").exists()


def test_what_does_not_end_when_it_is_told_to_is_killed(tmp_path):
    """It would be waited for as long as it lasts, whatever the time-out of the test."""
    blocks = [Snippet("sh", "(trap '' TERM; while :; do sleep 600; done) &\nwait\n", 3)]
    done = run_all(blocks, tmp_path, dict(os.environ), 0.5, grace_s=0.5)
    assert done.returncode == -signal.SIGKILL
    assert done.stderr == "line 3\nnot done after 0.5 s\n"
