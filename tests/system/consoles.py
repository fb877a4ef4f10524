"""Console blocks of a Markdown page: what is typed after `$ `, and what is printed then.

Printed and shown lines are compared by a simple rule: numbers stand for any number, ids of captures
for any id, `...` for any text within a line, and on a line of its own for any lines.
"""

import re
import shlex
import subprocess
from pathlib import Path
from typing import NamedTuple

__all__ = ["Typed", "matches", "run_consoles", "typed_in"]

_PROMPT = "$ "
_MARK = "\x01"
"""Comes before the number of each command in what the shell prints."""
_WILD = {r"\.\.\.": ".*", r"\b[0-9a-f]{32}\b": "[0-9a-f]{32}", r"\d+(?:[.,]\d+)*": None, " +": " +"}
"""What of a shown line is not taken literally, and what it stands for; None: for the like of it."""


class Typed(NamedTuple):
    """A command, and what the page shows of its output."""

    line: int
    """On the page, from 1."""
    command: str
    shown: str


def typed_in(text: str, line: int) -> list[Typed]:
    """Split a console block whose first line is on a line of the page."""
    found: list[Typed] = []
    for at, row in enumerate(text.splitlines(), line):
        if row.startswith(_PROMPT):
            found.append(Typed(at, row.removeprefix(_PROMPT), ""))
        else:
            found[-1] = found[-1]._replace(shown=f"{found[-1].shown}{row}\n")
    return found


def matches(shown: str, printed: str) -> bool:
    """Say whether what was printed is what the page shows."""
    pattern = "".join(
        r"(?:.*\n)*" if row == "..." else f"{_pattern(row)}\n" for row in shown.splitlines())
    return re.fullmatch(pattern, printed) is not None


def _pattern(row: str) -> str:
    parts = re.split(f"({'|'.join(_WILD)})", row)
    return "".join(next((stands_for or wild for wild, stands_for in _WILD.items()
                         if re.fullmatch(wild, part)), re.escape(part)) for part in parts)


def run_consoles(
    commands: list[Typed], desk: Path, environment: dict[str, str], timeout_s: float
) -> list[tuple[Typed, str]]:
    """Type commands into one shell, one after the other; give each with what was printed."""
    script = ["set -m; exec 2>&1", "trap 'kill $(jobs -p) 2>/dev/null; wait' EXIT"]
    for number, one in enumerate(commands):
        script += [f"printf '{_MARK}{number}\\n'", one.command]
    (desk / ".page").write_text("\n".join([*script, f"printf '{_MARK}{len(commands)}\\n'", ""]))
    # On a terminal, lines on stdout and stderr come in the order in which they are printed.
    environment = environment | {"PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
            ["bash", ".page"], cwd=desk, env=environment, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, text=True, start_new_session=True) as shell:
        try:
            printed, _ = shell.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            shell.terminate()  # its trap ends what it started
            printed, _ = shell.communicate()
    outputs = re.split(rf"{_MARK}(\d+)\n", printed)
    said = dict(zip(map(int, outputs[1::2]), outputs[2::2], strict=True))
    assert len(commands) in said, f"not done: {shlex.quote(printed[-2000:])}"
    return [(one, said[number]) for number, one in enumerate(commands)]
