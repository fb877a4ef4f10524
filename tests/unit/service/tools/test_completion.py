"""What shells make of the scripts that complete commands; each shell is asked itself."""

import os
import shutil
import subprocess

import pytest

from denseface.service.cli import main
from tests.waiting import LIMIT_S

_BASH = """
source "$0"
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_shtab_denseface
printf '%s\\n' "${COMPREPLY[@]}"
"""
_FISH = "source $argv[1]; complete -C (string join ' ' -- $argv[2..])"


@pytest.fixture(scope="module", params=["bash", "fish"])
def shell(request, tmp_path_factory):
    if shutil.which(request.param) is None:
        pytest.skip(f"{request.param} is not installed")
    return request.param, tmp_path_factory.mktemp("shell")


def completed(shell, capsys, *words):
    name, folder = shell
    path = folder / "script"
    if not path.exists():
        assert main(["completion", name]) == 0
        path.write_text(capsys.readouterr().out)
    (folder / "face.npz").touch()
    command = ["bash", "--norc", "-c", _BASH, path, "denseface", *words] if name == "bash" else [
        "fish", "--no-config", "-c", _FISH, path, "denseface", *words]
    done = subprocess.run(
        command, cwd=folder, env={"PATH": os.environ["PATH"], "HOME": str(folder)}, check=True,
        capture_output=True, text=True, timeout=LIMIT_S)
    assert done.stderr == ""
    return {line.partition("\t")[0] for line in done.stdout.split("\n") if line}


@pytest.mark.parametrize(("words", "offered"), [
    (["rec"], {"reconstruct", "record"}),
    (["keys", "al"], {"allow"}),
    (["press", "--gate-"], {"--gate-timeout"}),
    (["press", "--gate", ""], {"off", "wait", "refuse", "best"}),
    (["completion", ""], {"bash", "zsh", "fish"}),
    (["reconstruct", "fac"], {"face.npz"}),
    (["reconstruct", "--calibration", "fac"], {"face.npz"}),
])
def test_a_shell_offers_what_may_come_next(shell, capsys, words, offered):
    assert completed(shell, capsys, *words) == offered


def test_zsh_takes_the_script(tmp_path, capsys):
    if shutil.which("zsh") is None:
        pytest.skip("zsh is not installed")
    assert main(["completion", "zsh"]) == 0
    (tmp_path / "_denseface").write_text(capsys.readouterr().out)
    done = subprocess.run(
        ["zsh", "-f", "-c", "fpath=($PWD $fpath); autoload -Uz compinit && compinit -D -u\n"
         "print -- $_comps[denseface]; zsh -n _denseface"], cwd=tmp_path, check=True,
        capture_output=True, text=True, timeout=LIMIT_S)
    assert (done.stdout, done.stderr) == ("_denseface\n", "")
