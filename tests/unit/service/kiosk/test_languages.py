"""The texts: every language has them all, all are used, and none stands in the code."""

import json
import re
from typing import get_args

import pytest

from denseface.service.gate.faults import Fault
from denseface.service.kiosk import page_messages
from denseface.service.kiosk.installed import LANGUAGES
from denseface.service.kiosk.visit.hint_statistics import VisitEnd
from denseface.service.protocol.sensor_messages import LiveStateName
from tests.kiosk_states import LANGUAGES as NAMES

SOURCES = LANGUAGES.parent / "frontend" / "src"
TABLES = {path.stem: json.loads(path.read_text()) for path in LANGUAGES.glob("*.json")}
FAMILIES = {
    "hint": [*Fault, "other"],
    "failed": ["no_face", "sensor", "quality", "busy", "failed", "next"],
    "trouble": [f"{gone}{end}" for gone in (*page_messages.Trouble, "page")
                for end in ("", "_next")],
    "measurement": ["face_width", "face_length", "nose_width", "nose_length", "eye_distance"],
    "keep": [f"format_{form}" for form in ("glb", "ply", "stl", "png", "other")],
    "view": ["turn_left", "turn_right", "turn_up", "turn_down", "closer", "farther", "reset",
             "before", "after", "mesh", "points", "sigma"],
    "links": [f"{form}.{part}" for form in ("glb", "ply", "stl", "png")
              for part in ("name", "about")] + [
                  f"{page}.{part}" for page in ("gone", "unknown", "busy")
                  for part in ("title", "text")],
    "operator": [
        *(f"hub.{state}" for state in ("serving", "opening", "rebuilding")),
        *(f"sensor.{state}" for state in get_args(LiveStateName)),
        *(f"ends.{end}" for end in VisitEnd),
        *(f"visits.{count}" for count in ("visits", "captures", "faces", "kept")),
        *(f"captures.{column}" for column in ("picture", "when", "state", "actions")),
        *(f"state.{state}" for state in (
            "accepted", "working", "saving", "done", "failed", "dead", "other")),
        *(f"error.{error}" for error in (
            "token", "tries", "login", "hub", "refused", "unknown", "no_face", "settings",
            "offline", "request", "other"))],
}
"""Keys of which a part is said by the server or stands in a table of the page."""
OF_FAMILIES = {f"{family}.{name}" for family, names in FAMILIES.items() for name in names}


def _code() -> str:
    files = [*SOURCES.rglob("*.ts"), *LANGUAGES.parent.rglob("*.py")]
    return "\n".join(path.read_text() for path in files)


def _words(text: str) -> set[str]:
    return set(re.findall(r'["\'`]([a-z_]+(?:\.[a-z_0-9]+)*)["\'`]', text))


def test_the_languages_are_those_of_the_settings():
    assert TABLES.keys() == set(NAMES)


@pytest.mark.parametrize("name", sorted(TABLES))
def test_a_language_has_every_text_with_the_same_place_holders(name):
    english, table = TABLES["en"], TABLES[name]
    assert list(table) == list(english), "in the same order, for whoever compares them"
    for key, text in table.items():
        assert isinstance(text, str), key
        assert text == text.strip() != "", key
        assert sorted(re.findall(r"\{(\w*)\}", text)) == sorted(
            re.findall(r"\{(\w*)\}", english[key])), key


@pytest.mark.parametrize("name", sorted(set(TABLES) - {"en"}))
def test_a_language_is_translated(name):
    same = {key for key, text in TABLES[name].items() if text == TABLES["en"][key]
            and len(text) > 8 and not text.isupper()}
    assert len(same) <= 3, same


def test_arabic_alone_runs_from_right_to_left():
    assert {name for name, table in TABLES.items() if table["language.direction"] == "rtl"} == {
        "ar"}


def test_no_text_is_missing_and_none_unused():
    keys, words = set(TABLES["en"]), _words(_code())
    assert keys >= OF_FAMILIES
    assert not {word for word in words if word.split(".")[0] in FAMILIES.keys() - {"view", "links"}
                and "." in word and not word.endswith(".") and word not in keys}
    assert not keys - words - OF_FAMILIES


def test_every_key_that_the_page_asks_for_exists():
    asked = set()
    for path in SOURCES.rglob("*.ts"):
        asked |= set(re.findall(r'\bt\(\s*"([^"]+)"', path.read_text()))
        asked |= {key for pair in re.findall(r't\([^"()]*\? "([^"]+)" : "([^"]+)"',
                                             path.read_text()) for key in pair}
    assert len(asked) > 40, "they are found"
    assert asked <= set(TABLES["en"]), asked - set(TABLES["en"])


def test_no_text_stands_in_the_code():
    """Two words in a row between quotes are a text; errors are for whoever reads the console."""
    texts = []
    english = SOURCES / "view" / "words.ts"  # of a page that is a tool's, and no visitor's
    for path in set(SOURCES.rglob("*.ts")) - {english}:
        for line in path.read_text().splitlines():
            if re.match(r"\s*(\*|/\*|//)", line) or re.search(
                    r"Error\(|warn\(|complain\(|wrong\(|class:|class |className|font", line):
                continue
            texts += [f"{path.name}: {found}" for found in
                      re.findall(r'"([A-Z][a-z]+ [a-z]+[^"]*)"', line)]
    assert not texts
    page = (SOURCES.parent / "public" / "index.html").read_text()
    assert re.sub(r"<[^>]*>|\s", "", page) == "denseface"
