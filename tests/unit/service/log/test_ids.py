"""A log without captures' ids."""

import json
import sys

import pytest
import structlog

from denseface.service.log.events import configure
from denseface.service.log.ids import IdHider
from denseface.service.log.output import process_log
from tests.waiting import LIMIT_S

ID = "Visitor-17_a"


@pytest.fixture
def hider():
    return IdHider({})


def event(**fields):
    return {"event": "x", "process": "hub", **fields}


def test_an_id_becomes_the_same_hash_wherever_it_stands(hider):
    shown = hider(None, "info", event(
        capture_id=ID, reason=f"it was {ID}, not {ID}-b", file=f"{ID}.0af3.face", several=[ID],
        attempt=3))
    name = shown["capture_id"]
    assert ID not in name
    assert shown == event(capture_id=name, reason=f"it was {name}, not {ID}-b", attempt=3,
                          file=f"{name}.0af3.face", several=[name])
    assert hider(None, "info", event(capture_id="other"))["capture_id"] != name


@pytest.mark.parametrize("text", [
    f"capture {ID} is not in the store", f"/data/frames/{ID}.frame: is damaged",
    f"faces/{ID}.0a1b.face", f".{ID}.frame.123.tmp"])
def test_ids_that_only_stand_in_texts_are_found(hider, text):
    assert ID not in hider.hide(text)


def test_one_service_has_one_key_and_each_start_another():
    environment = {}
    first, child = IdHider(environment), IdHider(dict(environment))
    assert first.hide(f"capture {ID}") == child.hide(f"capture {ID}")
    assert first.hide(f"capture {ID}") != IdHider({}).hide(f"capture {ID}")


@pytest.mark.parametrize("how", ["json", "text"])
def test_no_line_shows_one(how, capfd, monkeypatch):
    monkeypatch.setattr("os.environ", {})
    configure(how, "test", ids=False)
    log = structlog.get_logger("x")
    log.info("done", capture_id=ID)
    try:
        raise ValueError(f"no {ID}")  # noqa: TRY301
    except ValueError:
        log.exception("failed")
    print(f"printed {ID}", file=sys.stderr)
    process_log.flush(LIMIT_S)
    text = capfd.readouterr().err
    assert text.count("id:") == 3
    assert ID not in text
    if how == "json":
        assert [json.loads(line)["event"] for line in text.splitlines()][:2] == ["done", "failed"]
