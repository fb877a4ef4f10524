"""The floor plan's limits, for what import-linter cannot count."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOPS = ("capture", "recon", "service")
ROOMS = sorted({path.parent.relative_to(ROOT)
                for top in TOPS for path in (ROOT / top).rglob("*.py")})
MODULES = sorted(path.relative_to(ROOT) for room in ROOMS for path in (ROOT / room).glob("*.py"))
MOST_MODULES, MOST_LINES = 15, 400
LONGER = {"service/protocol/messages.py"}
"""Every message is on one page."""


@pytest.mark.parametrize("room", ROOMS, ids=str)
def test_a_room_says_what_it_is_for_and_is_not_too_full(room):
    text = (ROOT / room / "__init__.py").read_text()
    purpose = ast.get_docstring(ast.parse(text))
    assert purpose
    assert len(purpose.splitlines()[0]) > 20
    modules = [path for path in (ROOT / room).glob("*.py") if not path.name.startswith("__")]
    assert len(modules) <= MOST_MODULES, f"{room}: {len(modules)}"


def test_no_module_is_longer_than_one_idea():
    lines = {str(module): len((ROOT / module).read_text().splitlines()) for module in MODULES}
    assert {name: count for name, count in lines.items() if count > MOST_LINES}.keys() <= LONGER
    assert 60 <= sorted(lines.values())[len(lines) // 2] <= 130, "the median is near 100"


def test_the_package_leads_to_the_folders():
    for top in TOPS:
        link = ROOT / "denseface" / top
        assert link.is_symlink()
        assert link.readlink() == Path("..") / top
