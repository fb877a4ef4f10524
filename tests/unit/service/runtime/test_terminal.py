"""Lines that are shown to people."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from denseface.service import runtime
from denseface.service.runtime.terminal import printable, say, suggest
from tests.waiting import LIMIT_S

SERVICE = Path(runtime.__file__).parents[1]
MAY_PRINT = {"runtime/terminal/_lines.py", "tools/doctor/questions.py"}
"""What escapes by itself; questions are answered in JSON, which is ASCII."""


@pytest.mark.parametrize(("given", "shown"), [
    ("Zoë, 日本 x", "Zoë, 日本 x"),
    ("\x1b[2J\x07\x9b31m\x7f", r"\x1b[2J\x07\x9b31m\x7f"),
    ("a\nb\rc\td\x85e\u2028f", r"a\nb\rc\td\x85e\u2028f"),
    ("gpj.\u202eexe\u2066\u200b\ufeff", r"gpj.\u202eexe\u2066\u200b\ufeff"),
    ("\udcff", r"\udcff"),
])
def test_what_a_terminal_would_obey_is_escaped(given, shown):
    assert printable(given) == shown


def test_each_line_that_is_said_is_one_line(capsys):
    say("a\nb", "c\x1b")
    assert capsys.readouterr().out == "a\\nb\nc\\x1b\n"


@pytest.mark.parametrize(("out", "error", "said"), [
    (True, True, "next: denseface view x    look at it\n"), (True, False, ""), (False, True, "")])
def test_the_next_command_is_said_to_who_sees_both_streams(monkeypatch, capsys, out, error, said):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: out)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: error)
    suggest("denseface view x", "look at it")
    assert capsys.readouterr() == ("", said)


def test_nothing_else_prints():
    found = {str(path.relative_to(SERVICE)) for path in SERVICE.rglob("*.py")
             for one in ast.walk(ast.parse(path.read_text()))
             if isinstance(one, ast.Call) and isinstance(one.func, ast.Name)
             and one.func.id == "print"}
    assert found == MAY_PRINT


def test_no_file_gets_the_number_of_a_closed_stream(tmp_path):
    code = ("import os\nfrom denseface.service.runtime.terminal import fill_standard_descriptors\n"
            "fill_standard_descriptors()\n"
            f"print(os.open({str(tmp_path / 'file')!r}, os.O_CREAT | os.O_WRONLY), flush=True)\n"
            "import subprocess, sys\n"
            "subprocess.run([sys.executable, '-c', 'print(1, file=__import__(\"sys\").stderr)'])")
    done = subprocess.run(["sh", "-c", 'exec "$0" -c "$1" 0>&- 2>&-', sys.executable, code],
                          stdout=subprocess.PIPE, text=True, timeout=LIMIT_S, check=True,
                          env={"PYTHONPATH": ":".join(sys.path)})
    assert int(done.stdout) > 2
    assert (tmp_path / "file").read_bytes() == b""
