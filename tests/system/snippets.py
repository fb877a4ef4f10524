"""The code blocks of a Markdown page, and a place where a reader would run them."""

import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import psutil
from markdown_it import MarkdownIt

from tests.system.running import PACE, REPOSITORY
from tests.waiting import LIMIT_S

__all__ = ["CONSOLES", "HOW_TOS", "PAGES", "SESSION", "Snippet", "reader", "run_all", "snippets"]

_HOW_TOS = {path.relative_to(REPOSITORY).as_posix(): "\n```diff\n" in path.read_text()
            for path in sorted((REPOSITORY / "docs/howto").glob("*.md"))}
"""Pages, and whether they change the code."""
HOW_TOS = tuple(page for page, changes in _HOW_TOS.items() if changes)
"""Run in a copy of the code, by `test_pages`."""
PAGES = ("README.md", "CONTRIBUTING.md", "docs/kiosk.md", "docs/operating.md",
         *(page for page, changes in _HOW_TOS.items() if not changes))
"""Run as shell and Python, by `test_pages`."""
CONSOLES = ("docs/first-hour.md", "docs/tutorial.md")
"""Typed, and compared with what they show, by `test_first_hour`."""
SESSION = "docs/python.md"
"""Run as one notebook, by `test_service`."""

_NOT_RUN = "<!-- not run: "
_FILE = "<!-- file: "
_PRELUDE = """\
set -eum
denseface() {
    case "$*" in
    'subscribe '*) set -- "$@" --count 1 ;;
    'purge '*) set -- "$@" --yes ;;
    esac
    command denseface "$@"
}
trap 'for job in $(jobs -p); do kill -- "-$job" 2>/dev/null || :; done; wait' EXIT
"""
"""Whoever reads ends `subscribe` by Ctrl-C and answers `purge`; nobody reads here."""


class Snippet(NamedTuple):
    """A fenced block.

    Attributes
    ----------
    language : the fence's word: `sh`, `python`, `diff`, `json`
    text : what is between the fences
    line : of the opening fence, from 1
    reason : why it is not run; empty where it is. From a comment before the block,
        `<!-- not run: REASON -->`
    file : where a reader saves it; empty where it is only run. From `<!-- file: PATH -->`
    """

    language: str
    text: str
    line: int
    reason: str = ""
    file: str = ""


def snippets(page: Path) -> list[Snippet]:
    """Read the fenced blocks of a page, in order."""
    found, note = [], ""
    for token in MarkdownIt().parse(page.read_text()):
        if token.type == "html_block":
            note = token.content.strip().removesuffix("-->").strip()
        elif token.type == "fence":
            assert token.map
            found.append(Snippet(
                token.info, token.content, token.map[0] + 1,
                note.removeprefix(_NOT_RUN) if note.startswith(_NOT_RUN) else "",
                note.removeprefix(_FILE) if note.startswith(_FILE) else ""))
            note = ""
        else:
            note = ""
    return found


@contextmanager
def reader(checkout: Path, environment: dict[str, str]) -> Iterator[tuple[Path, dict[str, str]]]:
    """Give a folder that looks like the checkout, and the environment of a user of one's own.

    What a page writes lands in that folder; `script/test` is not run within itself.
    """
    with tempfile.TemporaryDirectory(prefix="df-") as name:  # socket paths must be short
        home = Path(name)
        desk = home / "desk"
        (desk / ".venv").mkdir(parents=True)
        (desk / ".venv" / "bin").symlink_to(Path(sys.executable).parent)
        (desk / "fixtures").symlink_to(checkout / "fixtures")
        (desk / "script").mkdir()
        for script in (checkout / "script").iterdir():
            command = "exit 0" if script.name == "test" else f'exec {shlex.quote(str(script))} "$@"'
            (desk / "script" / script.name).write_text(f"#!/bin/sh\n{command}\n")
            (desk / "script" / script.name).chmod(0o755)
        folders = {f"XDG_{kind}_HOME": str(home / kind.lower()) for kind in ("DATA", "CONFIG")}
        runtime = home / "run"
        runtime.mkdir(mode=0o700)
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        yield desk, environment | PACE | folders | {
            "XDG_RUNTIME_DIR": str(runtime), "PATH": path, "PYTHONPATH": str(checkout)}


def run_all(
    blocks: list[Snippet], desk: Path, environment: dict[str, str], timeout_s: float,
    grace_s: float = LIMIT_S,
) -> "subprocess.CompletedProcess[str]":
    """Run shell and Python blocks one after the other, as in one terminal; save files and patches.

    Before each block its line is printed, so that the last such line names what failed. After
    `timeout_s` all is told to end, and killed after `grace_s` more.
    """
    script = [_PRELUDE]
    for number, block in enumerate(blocks):
        if block.reason:
            continue
        script.append(f"echo 'line {block.line}' >&2")
        saved = desk / f".block{number}"
        if block.file or block.language in ("python", "diff"):
            saved.write_text(block.text)
        if block.file:
            script.append(f"mkdir -p {shlex.quote(str(Path(block.file).parent))}; "
                          f"cp {saved} {shlex.quote(block.file)}")
        elif block.language == "python":
            script.append(f"{shlex.quote(sys.executable)} -W error {saved}")
        elif block.language == "diff":
            script.append(f"patch --quiet --strip=1 --fuzz=0 <{saved}")
        elif block.language == "sh":
            script.append(block.text)
    (desk / ".page").write_text("\n".join(script))
    with subprocess.Popen(
            ["bash", ".page"], cwd=desk, env=environment, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True) as shell:
        try:
            out, error = shell.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            shell.terminate()  # its trap ends what it started
            try:
                out, error = shell.communicate(timeout=grace_s)
            except subprocess.TimeoutExpired:
                _kill(shell.pid)
                out, error = shell.communicate()
            error += f"not done after {timeout_s} s\n"
        except BaseException:
            _kill(shell.pid)
            raise
    return subprocess.CompletedProcess(shell.args, shell.returncode, out, error)


def _kill(session: int) -> None:
    """Kill all processes of a session, those too that begin meanwhile."""
    left = True
    while left:
        left = False
        for process in psutil.process_iter():
            with suppress(ProcessLookupError, psutil.NoSuchProcess):
                if os.getsid(process.pid) == session and (
                        process.status() != psutil.STATUS_ZOMBIE):
                    process.kill()
                    left = True
