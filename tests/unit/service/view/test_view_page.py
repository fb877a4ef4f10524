"""What `docs/view.md` shows."""

import re
import shlex
from pathlib import Path

import pytest

from denseface.service.cli._parser import parse
from tests.system.snippets import snippets

PAGE = Path(__file__).resolve().parents[4] / "docs" / "view.md"
COMMANDS = [re.split(r" {3,}", line)[0] for block in snippets(PAGE)
            for line in block.text.splitlines() if line.startswith("denseface ")]


def test_there_are_some():
    assert len(COMMANDS) >= 6


@pytest.mark.parametrize("line", COMMANDS)
def test_a_command_is_read_as_it_stands(line):
    args = parse(shlex.split(line)[1:])
    assert args.command == "view"
    assert args.inputs or args.last
