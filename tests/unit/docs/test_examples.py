"""The examples are short, and the pages that show them say what is so."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseAnswer, BaseRequest

ROOT = Path(__file__).resolve().parents[3]
FOLDER = ROOT / "docs" / "examples"
EXAMPLES = [path.relative_to(FOLDER) for path in sorted(FOLDER.rglob("*"))
            if path.suffix in {".py", ".mjs", ".cpp", ".hpp"} and "node_modules" not in path.parts]
PAGE = (FOLDER / "README.md").read_text()
WIRE = (ROOT / "docs" / "wire.md").read_text()
_KINDS = {kind.model_fields["kind"].default: kind
          for kind in (*messages.TO_HUB, *messages.FROM_HUB)}
_ROWS = re.findall(r"^\| (.*?) \|(.*)\|$", WIRE.partition("### Fields\n")[2].partition("\n## ")[0],
                   re.MULTILINE)[2:]
FIELDS = {kind: cell for kinds, cell in _ROWS for kind in re.findall(r"`(\w+)`", kinds)}


@pytest.mark.parametrize("example", EXAMPLES, ids=str)
def test_an_example_is_under_80_lines_and_stands_on_the_page(example):
    lines = (FOLDER / example).read_text().splitlines()
    assert len(lines) < 80
    assert max(map(len, lines)) <= 100
    assert f"({example})" in PAGE


def test_the_page_compiles_as_the_tests_do():
    spec = importlib.util.spec_from_file_location("builder", ROOT / "script/build_examples.py")
    builder = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(builder)
    assert f"\n{builder.COMPILE}\n" in PAGE


def test_the_lock_has_the_packages_that_are_asked_for():
    asked = json.loads((FOLDER / "javascript" / "package.json").read_text())["dependencies"]
    lock = json.loads((FOLDER / "javascript" / "package-lock.json").read_text())["packages"]
    assert asked == lock[""]["dependencies"]
    for name, version in asked.items():
        assert lock[f"node_modules/{name}"]["version"] == version
    assert all(one["integrity"].startswith("sha512-") for path, one in lock.items() if path)


def test_every_kind_of_clients_has_its_fields_on_the_page():
    of_clients = {name for name, kind in _KINDS.items()
                  if issubclass(kind, BaseRequest | BaseAnswer)}
    assert set(FIELDS) == of_clients | {"denied", "preview", "hints"}


@pytest.mark.parametrize("kind", FIELDS)
def test_the_fields_of_a_kind_are_those_of_the_code(kind):
    fields = {name: field for name, field in _KINDS[kind].model_fields.items()
              if name not in {"kind", "version", "request"}}
    needed, _, optional = FIELDS[kind].partition("may:")
    assert set(re.findall(r"`(\w+)`", needed)) == {
        name for name, field in fields.items() if field.is_required()}
    assert set(re.findall(r"`(\w+)`", optional)) == {
        name for name, field in fields.items() if not field.is_required()}
