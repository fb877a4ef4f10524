"""Make distributions/core/pyproject.toml of pyproject.toml: the same code as `denseface-core`.

Its dependencies are a client's; its extras are for machines that do less than all.
"""

import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]
_CLIENT = ("numpy", "pydantic", "pyzmq")
_WORK = ("dev", "docs")
"""Extras for who works on denseface, from a checkout."""
_HEAD = """\
# Made by script/lock; do not edit. All of the code, and what a client needs; what an index has as
# `denseface` is the whole, by dependencies alone: ../whole (docs/decisions, 0062).
"""


def core_project(whole: str) -> str:
    """Give the file for the text of pyproject.toml."""
    lines = whole.partition("[tool.pytest.ini_options]")[0].rstrip("\n").split("\n")
    start = lines.index("[project]")
    while lines[start - 1].startswith("#"):
        del lines[start - 1]
        start -= 1
    for extra in _WORK:
        first, last = _array(lines, extra)
        while lines[first - 1].startswith("#"):
            first -= 1
        del lines[first:last + 1]
    first, last = _array(lines, "dependencies")
    lines[first + 1:last] = [line for line in lines[first + 1:last]
                             if line.startswith(tuple(f'    "{name}>' for name in _CLIENT))]
    text = "\n".join(lines).replace('name = "denseface"', 'name = "denseface-core"', 1)
    return _HEAD + text.replace('"denseface[', '"denseface-core[') + "\n"


def _array(lines: list[str], name: str) -> tuple[int, int]:
    """Give the first and the last line of an array."""
    first = next(i for i, line in enumerate(lines) if line.startswith(f"{name} = ["))
    last = next(i for i in range(first, len(lines)) if lines[i].endswith("]"))
    return first, last


if __name__ == "__main__":
    path = _ROOT / "distributions" / "core" / "pyproject.toml"
    made = core_project((_ROOT / "pyproject.toml").read_text())
    if "--check" not in sys.argv:
        path.write_text(made)
    elif path.read_text() != made:
        sys.exit(f"lock: {path} does not fit pyproject.toml; run script/lock")
