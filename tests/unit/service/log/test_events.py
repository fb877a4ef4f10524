"""The log: lines that a program can read, without image data."""

import json
import math
import re
import subprocess
import sys

import numpy as np
import pytest
import structlog

from denseface.service.log.events import configure
from denseface.service.log.output import process_log
from tests.waiting import LIMIT_S


def lines(text):
    """Read JSON as strictly as the standard says it."""
    def strict(word):
        raise ValueError(word)

    return [json.loads(line, parse_constant=strict) for line in text.splitlines()]


@pytest.fixture
def logged(capfd):
    """Gives what was logged since it was asked last."""
    def read():
        process_log.flush(LIMIT_S)
        return capfd.readouterr().err

    return read


@pytest.mark.parametrize("how", ["json", "text"])
def test_arrays_and_bytes_are_never_written(how, logged):
    configure(how, "test")
    image = np.full((4, 5, 3), 123, np.uint8)
    structlog.get_logger("x").info(
        "taken", image=image, raw=image.tobytes(), view=memoryview(image), both=[image, b"secret"],
        inside={"color": image, "n": 3}, scalar=np.uint8(7))
    text = logged()
    assert "123" not in re.sub(r"\d{4}-\S+Z", "", text)  # but in the time, perhaps
    assert "secret" not in text
    assert "uint8 [4, 5, 3]" in text
    assert "60 bytes" in text


def test_an_error_in_text_has_its_traceback(logged):
    configure("text", "test")
    try:
        raise ValueError("two\nlines")  # noqa: TRY301
    except ValueError:
        structlog.get_logger("x").exception("failed", capture_id="a")
    text = logged()
    assert "[error    ] failed                         capture_id=a process=test\n" in text
    assert "  ValueError: two\n  lines" in text


def test_what_came_from_outside_obeys_no_terminal_and_begins_no_line(logged):
    configure("text", "test")
    log = structlog.get_logger("x")
    evil = "a\x1b[31m\x9b1mb\u202ec\n2026-01-01 [info] forged\udc80"
    log.warning("refused", reason=evil, plain="\x1b]0;x\x07", several=[evil], by={"k": evil})
    log.warning(evil)
    print("printed \x1b[2J", file=sys.stderr)
    try:
        raise ValueError(evil)  # noqa: TRY301
    except ValueError:
        log.exception("failed")
    text = logged()
    assert all(line.isprintable() for line in text.split("\n"))
    assert not [line for line in text.split("\n") if line.startswith("2026-01-01")]
    assert r"reason='a\x1b[31m\x9b1mb\u202ec\n2026-01-01 [info] forged\udc80'" in text
    assert r"plain=\x1b]0;x\x07" in text
    assert r"printed \x1b[2J" in text


def test_what_is_printed_in_json_is_an_event(logged):
    configure("json", "test")
    print("two\nlines", "\x1b", file=sys.stderr)
    assert [line["event"] for line in lines(logged())] == ["two", "lines \x1b"]


def test_every_line_is_json_whatever_is_in_it(logged):
    configure("json", "test")
    log = structlog.get_logger("x")
    log.info("new\nline", value=math.nan, other=math.inf, thing=object(), text="\x1b[0m\udc80")
    try:
        raise ValueError("two\nlines")  # noqa: TRY301
    except ValueError:
        log.exception("failed")
    first, second = lines(logged())
    assert (first["process"], first["level"], first["event"]) == ("test", "info", "new\nline")
    assert (first["value"], first["other"]) == ("nan", "inf")
    assert "two\nlines" in second["exception"]


def test_what_python_and_libraries_say_is_json_too():
    code = """if True:
        import logging, threading, warnings
        from denseface.service.log.events import configure
        configure("json", "test")
        warnings.warn("old")
        logging.getLogger("library").error("broken %s", "pipe")
        def fail(): raise OSError("in a thread")
        thread = threading.Thread(target=fail); thread.start(); thread.join()
        class Bad:
            def __del__(self): raise OSError("in del")
        Bad()
        raise RuntimeError("at last")
    """
    ended = subprocess.run([sys.executable, "-W", "always", "-c", code], check=False,
                           capture_output=True, text=True, timeout=LIMIT_S)
    found = lines(ended.stderr)
    assert ended.returncode == 1
    assert [one["event"] for one in found] == [
        "old", "broken pipe", "uncaught", "uncaught", "uncaught"]
    assert found[0]["category"] == "UserWarning"
    for one, text in zip(found[2:], ("in a thread", "in del", "at last"), strict=True):
        assert text in one["exception"]
        assert (one["process"], one["level"]) == ("test", "critical")


def test_a_daemon_that_cannot_start_says_so_in_json(tmp_path):
    ended = subprocess.run(
        [sys.executable, "-m", "denseface", "hub", "--address", "nowhere", "--data", str(tmp_path),
         "--log", "json"], check=False, capture_output=True, text=True, timeout=LIMIT_S)
    (line,) = lines(ended.stderr)
    assert ended.returncode == 2
    assert (line["event"], line["process"]) == ("ended", "hub")
    assert "nowhere" in line["reason"]
