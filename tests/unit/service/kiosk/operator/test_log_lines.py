"""Where the operator's log comes from."""

import os
import sys

from denseface.service.kiosk.operator.log_lines import keep_lines, recent_log
from denseface.service.log.output import process_log


def test_a_log_that_is_a_file_is_read_from_its_end_by_whole_lines(tmp_path):
    path = tmp_path / "service.log"
    path.write_bytes(b"first\n" + b"x" * 99 + b"\n" + b"line\n" * 300_000)
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND)
    try:
        lines = recent_log({}, descriptor)
        assert len(lines) <= 2**20
        assert lines.startswith(b"line\n")
        path.write_bytes(b"one\ntwo\n")
        assert recent_log({}, descriptor) == b"one\ntwo\n"
    finally:
        os.close(descriptor)


def test_else_it_is_what_this_process_wrote(monkeypatch):
    reader, writer = os.pipe()
    keep_lines()
    try:
        process_log.put("a \x1b[1mline\x1b[0m of this process")
        assert recent_log({}, writer).endswith(b"a line of this process\n")
    finally:
        process_log.keep(0)
        os.close(reader)
        os.close(writer)


def test_the_journal_of_the_unit_is_asked(tmp_path, monkeypatch):
    journal = tmp_path / "journalctl"
    journal.write_text(f"#!{sys.executable}\nimport sys\nprint(sys.argv[1:])\n")
    journal.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    lines = recent_log({"INVOCATION_ID": "0a1b", "JOURNAL_STREAM": "8:9"}, -1)
    assert b"_SYSTEMD_INVOCATION_ID=0a1b" in lines
    assert b"journalctl" not in recent_log({"INVOCATION_ID": "0a1b --x", "JOURNAL_STREAM": "8"}, -1)
