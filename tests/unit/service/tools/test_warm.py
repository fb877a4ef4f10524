"""Compiling at installation, and what is said of it."""

import pytest

from denseface.recon.numerics.compilation.progress import Compiling
from denseface.service.cli import main
from denseface.service.tools import warm


@pytest.fixture
def compiling(monkeypatch):
    """Kernels that stand ready, without a look at them."""
    one = Compiling()
    one.add(None)
    monkeypatch.setattr(warm, "compiling", one)
    for room in (warm.worker, warm.measurement):
        monkeypatch.setattr(room, "warm", lambda: None)
    return one


def test_it_says_what_was_done_and_where_the_code_is(compiling, capsys, tmp_path):
    compiling.folders |= {tmp_path / "a" / "__pycache__", tmp_path / "b" / "__pycache__"}
    assert main(["warm"]) == 0
    assert capsys.readouterr().out == (
        f"1 kernels are ready, as they were before, below {tmp_path}\n")
    compiling.compiled = 1
    assert main(["warm"]) == 0
    assert capsys.readouterr().out == f"1 kernels are ready, compiled now, below {tmp_path}\n"


def test_what_can_be_kept_nowhere_is_a_failure(compiling, capsys):
    compiling.lost = "/opt: Read-only file system"
    assert main(["warm"]) == 1
    assert capsys.readouterr().err == (
        "denseface warm: compiled kernels can be kept nowhere; set NUMBA_CACHE_DIR to a folder "
        "that only you can write (/opt: Read-only file system)\n")
