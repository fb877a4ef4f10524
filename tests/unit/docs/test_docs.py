"""What the pages say of the code is so: paths, names, words, dates."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGES = sorted(path.relative_to(ROOT) for path in (
    *ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "fixtures").rglob("*.md"))
    if "node_modules" not in path.parts)
DECISIONS = sorted((ROOT / "docs" / "decisions").glob("*.md"))
GLOSSARY = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "docs" / "glossary.md").read_text().splitlines()
    if line.startswith("| ") and not line.startswith(("| word", "| ---"))]


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(), flags=re.S)
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        if "://" not in target:
            assert ((ROOT / page).parent / target).exists(), f"{page}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_files_that_are_named_exist(page):
    text = (ROOT / page).read_text()
    for name in re.findall(r"`((?:capture|recon|service|tests|bench|script|docs)/[\w./-]+)`", text):
        assert (ROOT / name).exists() or is_made_by_the_reader(name, text), f"{page}: {name}"


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_tests_that_are_named_exist(page):
    for name in re.findall(r"`(test_\w+)`", (ROOT / page).read_text()):
        assert name in names_of_tests(), f"{page}: {name}"


@cache
def names_of_tests():
    files = list((ROOT / "tests").rglob("test_*.py"))
    return {path.stem for path in files} | set(re.findall(
        r"^ *(?:async )?def (test_\w+)\(", "\n".join(map(Path.read_text, files)), re.M))


def is_made_by_the_reader(name, text):
    return f"<!-- file: {name} -->" in text


@pytest.mark.parametrize("path", DECISIONS, ids=lambda path: path.name[:4])
def test_a_decision_has_number_status_and_date(path):
    title, status = path.read_text().splitlines()[:2]
    number = path.name[:4]
    assert re.fullmatch(rf"# {number}: \S.+", title)
    assert re.fullmatch(r"Status: (accepted|replaced by \[\d{4}\]\(\S+\.md\))\. "
                        r"Date: \d{4}-\d\d-\d\d\.", status)


def test_decisions_are_numbered_without_gaps():
    assert [path.name[:4] for path in DECISIONS] == [
        f"{number:04}" for number in range(1, len(DECISIONS) + 1)]


@cache
def names_in(path):
    """Every name that a module makes: classes, functions, arguments, variables, attributes."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        match node:
            case ast.ClassDef(name=name) | ast.FunctionDef(name=name) | \
                    ast.AsyncFunctionDef(name=name) | ast.arg(arg=name) | ast.alias(name=name):
                names.add(name)
            case ast.Name(id=name) | ast.Attribute(attr=name):
                names.add(name)
    return names


@pytest.mark.parametrize("row", GLOSSARY, ids=lambda row: row[0])
def test_a_word_is_in_the_code_and_no_second_one(row):
    _, meaning, where, others = row
    assert meaning
    path, *name = re.findall(r"`([^`]+)`", where)
    assert (ROOT / path).is_file(), path
    assert not name or name[0] in names_in(ROOT / path), where
    for other in filter(None, others.split(", ")):
        for code in (ROOT / Path(path).parts[0]).rglob("*.py"):
            for found in names_in(code):
                words = re.findall(r"[A-Z]?[a-z]+", found)
                assert other not in {word.lower().removesuffix("s") for word in words} | {
                    word.lower() for word in words}, f"{code}: {found}: {row[0]}, not {other}"


def test_a_word_stands_once_in_the_glossary():
    words = [row[0] for row in GLOSSARY]
    assert len(words) == len(set(words)) > 30
