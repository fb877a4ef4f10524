"""systemd's units: systemd reads them, thinks well of their sandbox, and only ours are touched."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from denseface.service import cli
from denseface.service.errors import UsageError
from denseface.service.tools.units import installation, program
from denseface.service.tools.units.program import Program, as_word, find_program
from denseface.service.tools.units.rendering import TARGET, Choice, render
from tests.system.snippets import snippets
from tests.waiting import LIMIT_S

ROOT = Path(__file__).resolve().parents[4]
ALL = {"denseface-hub.service", "denseface-capture.service", "denseface-capture@.service",
       "denseface-worker@.service", "denseface-kiosk.service", TARGET}
TRUE = Program("/bin/true")
EXPOSURE = 15
"""Tenths, above which `systemd-analyze security` has a unit fail."""


def systemd_analyze(*arguments: object) -> str:
    with tempfile.TemporaryDirectory() as home:
        done = subprocess.run(
            ["systemd-analyze", *map(str, arguments)], check=False, text=True,
            capture_output=True, timeout=LIMIT_S,
            env={"PATH": os.environ["PATH"], "XDG_RUNTIME_DIR": home, "HOME": home})
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    return said


@pytest.fixture(scope="module")
def systemd():
    """Skip where the machine's systemd cannot look at files."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze here")
    version = int(re.findall(r"\d+", systemd_analyze("--version"))[0])
    if version < 250:
        pytest.skip(f"systemd {version} cannot look at files offline")


def written(folder: Path, units: dict[str, str]) -> list[Path]:
    for name, text in units.items():
        (folder / name).write_text(text)
    return [folder / name for name in units]


def drop_ins() -> list[tuple[str, str]]:
    """Give name and text of each drop-in on the page."""
    texts = [one for block in snippets(ROOT / "docs/systemd.md")
             for one in re.split(r"^(?=# /)", block.text, flags=re.M)]
    return [(path[1], one) for one in texts
            if (path := re.match(r"# /etc/systemd/system/(\S+\.d/\S+\.conf)\n", one))]


@pytest.mark.parametrize("homes", [(), ("/homes/a", "/homes/b")])
def test_systemd_reads_every_unit_and_finds_its_sandbox_tight(systemd, tmp_path, homes):
    services = written(tmp_path, render(Choice(3), Program("/bin/true", homes)))
    assert {path.name for path in services} == ALL
    assert systemd_analyze("verify", *services) == ""
    services.remove(tmp_path / TARGET)
    said = systemd_analyze("security", "--offline=true", f"--threshold={EXPOSURE}", *services)
    assert len(re.findall(r"Overall exposure level for .*: [01]\.\d ", said)) == len(services)


def test_systemd_reads_what_a_users_own_manager_gets(systemd, tmp_path):
    units = render(Choice(1, user=True), TRUE)
    assert systemd_analyze("verify", "--user", *written(tmp_path, units)) == ""
    for text in units.values():
        assert not re.search("DynamicUser|^Protect|^Private|^IPAddress|Directory=", text, re.M)
        assert not re.search(r"^#.*\n\n", text, re.M), "a comment on nothing"
    assert "WantedBy=default.target" in units[TARGET]
    assert "NoNewPrivileges=yes" in units["denseface-hub.service"]
    assert "EnvironmentFile=-%E/denseface/hub.env" in units["denseface-hub.service"]


def test_systemd_reads_the_drop_ins_of_the_page(systemd, tmp_path):
    shown = drop_ins()
    assert len(shown) >= 4
    units = written(tmp_path, render(Choice(1, ("left",)), TRUE))
    for name, text in shown:
        assert name.split(".d/")[0] in ALL
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    assert systemd_analyze("verify", *units) == ""


def test_systemd_finds_a_program_in_a_folder_of_any_name(systemd, tmp_path):
    odd = tmp_path / "a b%n$c;ä"
    odd.mkdir()
    (odd / "denseface").symlink_to("/bin/true")
    units = render(Choice(1), Program(as_word(str(odd / "denseface"))))
    paths = written(tmp_path, units)
    assert systemd_analyze("verify", *paths) == ""
    (odd / "denseface").unlink()
    with pytest.raises(AssertionError, match="is not executable"):
        systemd_analyze("verify", paths[0])


def test_the_target_wants_what_was_chosen():
    def wanted(**choice):
        return re.findall(r"denseface-(\S+)\.service", render(Choice(**choice), TRUE)[TARGET])

    assert wanted(workers=2) == ["hub", "capture", "worker@1", "worker@2", "kiosk"]
    assert wanted(workers=1, sensors=("left", "right"), kiosk=False) == [
        "hub", "capture@left", "capture@right", "worker@1"]
    several = render(Choice(1), TRUE)["denseface-capture@.service"]
    assert "capture --name %i --source ${DENSEFACE_SOURCE}\n" in several
    assert "EnvironmentFile=-%E/denseface/capture-%i.env" in several


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A machine that systemd runs on: its folder; `systemctl` notes what it is asked."""
    (tmp_path / "bin").mkdir()
    (tmp_path / "units").mkdir()
    systemctl = tmp_path / "bin/systemctl"
    systemctl.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\n'
                         f"[ ! -e {tmp_path}/broken ] || {{ echo no bus >&2; exit 1; }}\n")
    systemctl.chmod(0o700)
    monkeypatch.setenv("PATH", f"{tmp_path}/bin:/usr/bin:/bin")
    monkeypatch.setattr(installation, "_BOOTED", tmp_path)
    monkeypatch.setattr(installation, "_SYSTEM", tmp_path / "units")
    monkeypatch.setattr(installation, "find_program", lambda **_: TRUE)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path


def names(folder):
    return {path.name for path in folder.iterdir()}


def asked(machine):
    found = (machine / "asked").read_text().splitlines() if (machine / "asked").exists() else []
    (machine / "asked").unlink(missing_ok=True)
    return found


def test_units_are_written_read_by_systemd_and_removed_without_a_trace(machine, capsys):
    other = machine / "units/other.service"
    other.write_text("[Service]\n")
    assert cli.main(["install-units", "--workers", "2"]) == 0
    assert names(machine / "units") == ALL | {"other.service"}
    assert {path.stat().st_mode & 0o777 for path in (machine / "units").glob("denseface*")} == {
        0o644}
    assert sorted(capsys.readouterr().out.splitlines()) == sorted(
        str(machine / "units" / name) for name in ALL)
    assert asked(machine) == ["daemon-reload"]
    assert cli.main(["install-units", "--workers", "3"]) == 0
    assert capsys.readouterr().out == f"{machine / 'units' / TARGET}\n"
    assert asked(machine) == ["daemon-reload"]
    assert cli.main(["install-units", "--uninstall"]) == 0
    assert names(machine / "units") == {"other.service"}
    assert asked(machine) == [
        "stop denseface.target", "disable --quiet denseface.target denseface-worker@.service "
        "denseface-capture@.service", "daemon-reload"]
    capsys.readouterr()
    assert cli.main(["install-units", "--uninstall"]) == 0
    assert capsys.readouterr().out == f"{machine / 'units'}: there are no units of denseface\n"
    assert asked(machine) == []


def test_a_users_units_go_to_their_own_folder(machine, capsys):
    assert cli.main(["install-units", "--user"]) == 0
    assert names(machine / "config/systemd/user") == ALL
    assert asked(machine) == ["--user daemon-reload"]
    assert names(machine / "units") == set()


@pytest.mark.parametrize("how", ["changed", "foreign", "link", "huge"])
def test_what_was_changed_by_hand_or_is_another_s_stays_unless_forced(machine, capsys, how):
    assert cli.main(["install-units"]) == 0
    hub = machine / "units/denseface-hub.service"
    match how:
        case "changed":
            hub.write_text(hub.read_text().replace("WatchdogSec=30", "WatchdogSec=60"))
        case "foreign":
            hub.write_text("[Service]\nExecStart=/bin/true\n")
        case "link":
            hub.unlink()
            hub.symlink_to("/dev/null")
        case "huge":
            hub.write_text(hub.read_text() + "#" * 2**17)
    before = hub.read_text()
    (machine / "units/denseface-kiosk.service").unlink()
    capsys.readouterr()
    asked(machine)
    for flags in ([], ["--uninstall"]):
        assert cli.main(["install-units", *flags]) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert f"{hub}: " in err
        assert "--force" in err
        assert hub.read_text() == before
        assert not (machine / "units/denseface-kiosk.service").exists(), "all or nothing"
    assert asked(machine) == []
    assert cli.main(["install-units", "--force"]) == 0
    assert "sha256" in hub.read_text()
    assert not hub.is_symlink()
    assert cli.main(["install-units", "--uninstall"]) == 0
    assert names(machine / "units") == set()


def test_a_dry_run_prints_all_and_writes_nothing(machine, capsys):
    assert cli.main(["install-units", "--dry-run", "--workers", "1"]) == 0
    out, err = capsys.readouterr()
    for name, text in render(Choice(1), TRUE).items():
        assert f"# {machine / 'units' / name}\n{text}" in out
    assert out.endswith("# systemctl enable --now denseface.target\n")
    assert (err, names(machine / "units"), asked(machine)) == ("", set(), [])


def test_where_systemd_does_not_answer_it_is_said(machine, capsys):
    (machine / "broken").touch()
    assert cli.main(["install-units"]) == 1
    assert capsys.readouterr().err == (
        "denseface install-units: systemctl daemon-reload: no bus\n")
    assert cli.main(["install-units", "--uninstall"]) == 1
    assert names(machine / "units") == ALL, "what may run keeps its unit"


def test_where_there_is_no_systemd_it_is_one_line_and_a_folder_of_ones_own_does(
        machine, monkeypatch, capsys):
    monkeypatch.setattr(installation, "_BOOTED", machine / "none")
    assert cli.main(["install-units"]) == 2
    assert capsys.readouterr().err == (
        "denseface install-units: systemd does not run here: --dry-run shows the units, "
        "--folder DIR writes them for another machine\n")
    for flags in ([], ["--uninstall"]):
        assert cli.main(["install-units", "--folder", str(machine / "other"), *flags]) == 0
    assert (names(machine / "other"), asked(machine)) == (set(), [])
    (machine / "file").touch()
    assert cli.main(["install-units", "--folder", str(machine / "file")]) == 2
    assert f"{machine / 'file'}: " in capsys.readouterr().err


def test_a_program_in_a_home_folder_is_bound_and_one_that_services_do_not_see_is_refused(
        tmp_path, monkeypatch):
    home = tmp_path / "home"
    environment = home / "somebody" / "environment"
    environment.mkdir(parents=True)
    monkeypatch.setattr(sys, "prefix", str(environment))
    monkeypatch.setattr(sys, "base_prefix", "/usr")
    monkeypatch.setattr(program, "denseface", type("Package", (), {
        "__file__": str(environment / "denseface/__init__.py")}))
    with pytest.raises(UsageError, match="services have temporary folders of their own"):
        find_program(sandboxed=True)
    monkeypatch.setattr(program, "_TEMPORARY", ())
    monkeypatch.setattr(program, "_HOMES", (home,))
    home.chmod(0o700)
    assert find_program(sandboxed=True).homes == (str(environment),)
    monkeypatch.setattr(sys, "base_prefix", str(home / "a b"))
    (home / "a b").mkdir()
    with pytest.raises(UsageError, match="only a path of letters, digits and"):
        find_program(sandboxed=True)
    monkeypatch.setattr(sys, "base_prefix", "/usr")
    environment.chmod(0o750)
    with pytest.raises(UsageError, match=r"other users may not enter this folder.*chmod o\+rx"):
        find_program(sandboxed=True)
    assert find_program(sandboxed=False).homes == ()
    monkeypatch.setattr(program, "_HOMES", ())
    environment.chmod(0o755)
    with pytest.raises(UsageError, match="may not enter"):
        find_program(sandboxed=True)
    monkeypatch.setattr(program.site, "getusersitepackages", lambda: str(environment))
    with pytest.raises(UsageError, match="pip install --user"):
        find_program(sandboxed=True)


@pytest.mark.parametrize("path", ["/opt/a\nExecStartPre=/bin/rm", '/a"b', "/a'b", "/a\\b"])
def test_a_path_that_no_unit_can_name_is_refused(path):
    with pytest.raises(UsageError, match="starts no program with such characters"):
        as_word(path)
