"""Every block of code on every page is run by a test, is checked here, or says why not."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from denseface import DepthMeaning, FrameOrigin, load_calibration, save_frame
from denseface.service.kiosk.consent_text import load_consent_text
from denseface.service.security import read_pair
from tests.system.snippets import CONSOLES, HOW_TOS, PAGES, SESSION, snippets
from tests.unit.frames import frame

ROOT = Path(__file__).resolve().parents[3]
ALL = sorted(path.relative_to(ROOT).as_posix()
             for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")))
RUN = {page: {"sh", "python"} for page in PAGES} | {
    page: {"sh", "python", "diff"} for page in HOW_TOS} | {
    page: {"console"} for page in CONSOLES} | {SESSION: {"python"}, "docs/batch.md": {"sh"}}
"""Kinds of blocks that a test of each page runs; `json` is checked below."""
SITE = {"{toctree}", "{include}", "{eval-rst}", "{decisions}", "math"}
"""What `script/docs` reads; a mistake there is one of its errors."""
NOT_RUN = 32
"""Blocks that say why they are not."""


@cache
def blocks():
    return [(page, block) for page in ALL for block in snippets(ROOT / page)]


def test_blocks_are_run_or_say_why_not():
    for page, block in blocks():
        if block.reason:
            assert len(block.reason) > 10, f"{page}:{block.line}"
        elif not block.file:
            assert block.language.split(" ")[0] in RUN.get(page, set()) | SITE | {"", "json"}, (
                f"{page}:{block.line}: {block.language} is run by no test")


def test_what_somebody_would_type_is_told_from_files_and_pictures():
    for page, block in blocks():
        if not block.language:
            typed = re.search(r"^(\$ |denseface \S|pip |python |script/)", block.text, re.M)
            assert not typed, f"{page}:{block.line}: {typed[0]}... without sh or console before it"


def test_what_is_not_run_is_counted():
    found = [f"{page}:{block.line}: {block.reason}" for page, block in blocks() if block.reason]
    assert len(found) == NOT_RUN, "\n".join(found)


def test_a_frame_file_is_as_its_page_says(tmp_path):
    page = (ROOT / "docs/frames.md").read_text().partition("## A calibration")[0]
    said = {name.strip(" `") for line in page.splitlines() if line.startswith("| `")
            for name in line.split("|")[1].split(",")}
    whole = frame(
        np.zeros((120, 160), np.uint16), np.zeros((120, 160, 3), np.uint8),
        depth_meaning=DepthMeaning(max_mm=4000), origin=FrameOrigin(
            sensor="A", captured_at="2026-11-30T00:00:00Z", source="a.oni#0"))
    save_frame(whole, tmp_path / "frame.npz", quickly=True)
    with np.load(tmp_path / "frame.npz") as written:
        assert said == set(written)


def json_of(page):
    (block,) = (one for on, one in blocks() if on == page and one.language == "json")
    json.loads(block.text)
    return block.text


def test_the_calibration_that_is_shown_is_one(tmp_path):
    (tmp_path / "shown.json").write_text(json_of("docs/frames.md"))
    shown = load_calibration(tmp_path / "shown.json")
    assert shown.depth.fx == pytest.approx(575.8)
    assert shown.depth_to_color.translation_mm == (-23, 0, 0)


def test_the_text_of_a_consent_that_is_shown_is_one(tmp_path):
    (tmp_path / "shown.json").write_text(json_of("docs/kiosk.md"))
    assert load_consent_text(tmp_path / "shown.json", ("en", "de")).version == "museum-2"


def test_the_key_that_is_shown_is_one(tmp_path):
    path = tmp_path / "bench2.secret"
    path.write_text(json_of("docs/wire.md"))
    path.chmod(0o600)
    assert len(read_pair(path).public) == 40


def test_no_other_page_shows_json_that_nobody_reads():
    assert {page for page, block in blocks() if block.language == "json"} == {
        "docs/frames.md", "docs/kiosk.md", "docs/wire.md"}
