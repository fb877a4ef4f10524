"""`summary.html`: what became of an archive, in one file that nothing from outside can change."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.service.errors import CorruptFileError, UsageError
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.summary import _figures, _table
from denseface.service.tools.batch.summary._figures import Distribution, gather
from denseface.service.tools.batch.summary._table import SummaryFile
from denseface.service.tools.batch.summary.page import write_html
from denseface.service.tools.batch.summary.writer import SummaryWriter

PICTURE = b"\xff\xd8\xff" + bytes(300)


def face(source, frame, sigma_mm=0.5, **more):
    return Row(**{"source": source, "frame": frame, "state": "face", "dense": 1000, "seconds": 0.1,
                  "sigma_mm": sigma_mm, "output": f"{frame}.npz", "thumbnail": PICTURE} | more)


def without(source, frame, why="nobody", state="no_face", error="NoFaceError", **more):
    return Row(source=source, frame=frame, state=state, error=error, why=why, **more)


class Parsed(HTMLParser):
    def __init__(self, html):
        super().__init__()
        self.elements, self.links, self.open, self.text = [], [], [], ""
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append(tag)
        names = [name for name, _ in attrs]
        assert not any(name.startswith("on") or name == "style" for name in names)
        self.links += [value for name, value in attrs if name in ("src", "href")]
        if tag == "img":
            assert dict(attrs)["alt"]
        if tag not in ("meta", "img", "br", "rect", "line"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if self.open and self.open[-1] == tag:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def page_of(folder, *rows):
    with SummaryWriter(folder) as summary:
        summary.add(*rows)
    html = write_html(folder).read_text("utf-8")
    parsed = Parsed(html)
    assert parsed.elements.count("script") == 0
    assert all(link.startswith(("data:image/jpeg;base64,", "./")) for link in parsed.links)
    assert "default-src 'none'; img-src data:; style-src 'sha256-" in html
    return parsed


def test_the_page_counts_groups_errors_and_shows_the_worst_first(tmp_path):
    page = page_of(
        tmp_path,
        *(face("a.oni", number, sigma_mm=0.3 + number / 100, warnings=("dark",))
          for number in range(30)),
        without("a.oni", 30, "no face found: the box at (1, 2) is 30 mm wide"),
        without("b.oni", 0, "no face found: the box at (7, 8) is 44 mm wide"),
        without("b.oni", 1, "a tin"),
        without("c.oni", None, "c.oni: cut", "unreadable", "UnreadableSourceError"),
        without("d.oni", 1, "its worker died", "failed", "KilledWorker", attempts=3))
    words = " ".join(page.text.split())
    assert "35 frames of 4 sources; 3 s of the workers' time; 1 frame tried more than once" in words
    assert "face 30 85.7 % no face 3 8.6 % unreadable 1 2.9 % failed 1 2.9 %" in words
    assert "NoFaceError no face, 3 frames" in words
    assert "box at (1, 2) is 30 mm wide and 1 alike a tin" in words
    assert words.index("NoFaceError") < words.index("KilledWorker") < words.index("The worst faces")
    assert [link for link in page.links if link.startswith(".")][:3] == [
        "./29.npz", "./28.npz", "./27.npz"]
    assert "median 0.44 mm, of nine in ten 0.31 to 0.5" in words
    assert "dark30" in words


def test_a_page_of_nothing_and_of_errors_alone_is_a_page(tmp_path):
    assert "0 frames of 0 sources" in page_of(tmp_path / "none").text
    page = page_of(tmp_path / "errors", without("a", 0), without("a", 1, "b", thumbnail=PICTURE))
    assert "face 0 0.0 %" in " ".join(page.text.split())


NASTY = "<script>alert('1')</script>\"'&\u202e\x1b[31m"


def test_what_is_from_outside_is_text_and_nothing_else(tmp_path):
    page = page_of(
        tmp_path / "<i>",
        face(NASTY, 0, output=f"a b/{NASTY}#?%.npz", warnings=(NASTY,), worker=NASTY),
        face("javascript:alert(1)", 0, output="javascript:alert(1)"),
        without(NASTY, 1, NASTY), without(NASTY, None, NASTY, "unreadable", "OSError"))
    assert "<script>alert('1')" in page.text
    assert "\x1b" not in page.text
    assert "\u202e" not in page.text
    assert "./javascript%3Aalert%281%29" in page.links
    assert {"i", "script"}.isdisjoint(page.elements)


def test_the_page_is_as_large_for_many_frames_of_many_kinds(tmp_path, monkeypatch):
    monkeypatch.setattr(_table, "GROUP_ROWS", 200)
    monkeypatch.setattr(_figures, "_MOST_TEXTS", 100)

    def rows(count):
        return [face(f"{at:06}", 0, warnings=(f"warning {at}",)) if at % 2 else
                without(f"{at:06}", 0, f"reason {'abcdefghijklmnop'[at % 16]} {at}" * 3,
                        error=f"Error{at}") for at in range(count)]

    page_of(tmp_path / "few", *rows(400))
    page = page_of(tmp_path / "many", *rows(4000))
    few, many = ((tmp_path / name / "summary.html").stat().st_size for name in ("few", "many"))
    assert many < 1.1 * few
    assert f"And {2000 - 24:,} frames of rarer kinds" in page.text


@settings(max_examples=25)
@given(st.lists(st.floats(1e-3, 1e6), min_size=1, max_size=300), st.floats(0.01, 0.99))
def test_quantiles_are_those_of_the_values(values, share):
    found = Distribution()
    for part in np.array_split(np.array(values), 3):
        found.add(part)
    found.draw_bars(whole=False)
    found.add_to_bars(np.array(values))
    exact = float(np.quantile(values, share, method="inverted_cdf"))
    assert found.quantile(share) == pytest.approx(exact, rel=0.005)
    assert found.bars.sum() + found.outside == len(values)
    assert (found.least, found.most) == (min(values), max(values))


def test_the_worst_of_groups_are_the_worst_of_all(tmp_path, monkeypatch):
    monkeypatch.setattr(_table, "GROUP_ROWS", 50)
    sigmas = np.random.default_rng(3).permutation(400) / 100
    with SummaryWriter(tmp_path) as summary:
        summary.add(*(face("a", number, sigma_mm=float(sigma), face_score=float(sigma / 4))
                      for number, sigma in enumerate(sigmas)))
    with SummaryFile(tmp_path / "summary.parquet") as file:
        found = gather(file)
    assert [row.sigma_mm for row in found.worst] == sorted(sigmas)[:-25:-1]
    assert [row.sigma_mm for row in found.doubtful] == sorted(sigmas)[:12]
    assert len({row.key for row in found.spread}) == 48


def test_what_a_killed_run_left_is_in_the_page_and_a_running_one_is_not_disturbed(tmp_path):
    running = SummaryWriter(tmp_path)
    running.add(face("a", 0))
    assert "0 frames" in write_html(tmp_path).read_text("utf-8")
    running._journal.close()  # as the system does of a process that is killed
    assert "1 frame of 1 source" in write_html(tmp_path).read_text("utf-8")


def test_without_a_summary_there_is_no_page(tmp_path):
    with pytest.raises(UsageError, match=r"has no summary\.parquet"):
        write_html(tmp_path)
    with pytest.raises(UsageError, match=r"has no summary\.parquet"):
        write_html(tmp_path / "nowhere")
    (tmp_path / "summary.parquet").write_bytes(b"no")
    with pytest.raises(CorruptFileError, match="move it away"):
        write_html(tmp_path)
    assert not re.findall("html", " ".join(one.name for one in tmp_path.iterdir()))
