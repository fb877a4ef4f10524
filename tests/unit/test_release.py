"""What a release is made with: script/release, script/archives.py, the workflows."""

import hashlib
import itertools
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from datetime import date
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

import denseface
from tests.waiting import LIMIT_S

_ROOT = Path(__file__).resolve().parents[2]
_WORKFLOWS = sorted((_ROOT / ".github" / "workflows").glob("*.yml"))
_DAY = date(2026, 12, 24)


def _script(name):
    loader = SourceFileLoader(name.partition(".")[0], str(_ROOT / "script" / name))
    module = module_from_spec(spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def release():
    return _script("release")


@pytest.fixture(scope="module")
def archives():
    return _script("archives.py")


def _git(folder, *arguments):
    subprocess.run(
        ["git", "-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false",
         *arguments], cwd=folder, check=True, capture_output=True,
        env=os.environ | {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull})


@pytest.fixture
def checkout(tmp_path):
    """A repository with what a release changes, as it is here, and something to tell of it."""
    for name in ("denseface/version.py", "distributions/whole/pyproject.toml"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_bytes((_ROOT / name).read_bytes())
    (tmp_path / "CHANGELOG.md").write_text(
        "# Changelog\n\n## Unreleased\n- New.\n- Newer.\n\n## 0.0.1 - 2026-01-01\n- Old.\n")
    _git(tmp_path, "init", "--quiet", "--initial-branch", "main")
    _commit(tmp_path)
    return tmp_path


def _commit(folder):
    _git(folder, "add", "--all")
    _git(folder, "commit", "--quiet", "--message", "A commit")


def test_a_release_is_prepared_checked_and_told(release, checkout):
    release.prepare(checkout, "7.8.9", _DAY)
    assert release.current(checkout) == "7.8.9"
    whole = tomllib.loads((checkout / "distributions/whole/pyproject.toml").read_text())["project"]
    extras = whole["optional-dependencies"].values()
    asked = [*whole["dependencies"], *itertools.chain.from_iterable(extras)]
    assert whole["version"] == "7.8.9"
    assert {one.partition("==")[2] for one in asked} == {"7.8.9"}
    assert "\n## 7.8.9 - 2026-12-24\n- New." in (checkout / "CHANGELOG.md").read_text()
    line, = release.obstacles(checkout, "7.8.9")
    assert line == ("not committed: CHANGELOG.md, denseface/version.py, "
                    "distributions/whole/pyproject.toml")
    _commit(checkout)
    release.check(checkout, "7.8.9")
    assert release.notes(checkout, "7.8.9") == "- New.\n- Newer.\n"


def test_all_that_stands_against_a_release_is_said(release, checkout):
    (checkout / "left").touch()
    _git(checkout, "checkout", "--quiet", "-b", "other")
    _git(checkout, "commit", "--quiet", "--allow-empty", "--message", "More")
    _git(checkout, "tag", "v7.8.9", "main")
    now = denseface.__version__
    with pytest.raises(release.ReleaseError) as caught:
        release.check(checkout, "7.8.9")
    lines = str(caught.value).splitlines()
    assert lines[:-1] == [
        f"denseface/version.py has {now}: script/release prepare 7.8.9",
        f"distributions/whole/pyproject.toml has {now}: script/release prepare 7.8.9",
        "CHANGELOG.md: no section '## 7.8.9 - YYYY-MM-DD'",
        "CHANGELOG.md has '## Unreleased', too",
        "not committed: left",
        "what is checked out is not on main"]
    assert re.fullmatch(r"the tag v7\.8\.9 is elsewhere, at \w{10}: .*", lines[-1])


@pytest.mark.parametrize(("version", "said"), [
    ("0.0.1", "0.0.1 is older than"), ("v1.0.0", "expected a version"), ("1.0", "expected a ver"),
    ("1.0.0rc0", "expected a version"), ("1.00.0", "expected a version"), ("", "found ''")])
def test_a_wrong_version_changes_nothing(release, checkout, version, said):
    before = (checkout / "CHANGELOG.md").read_text()
    with pytest.raises(release.ReleaseError, match=said):
        release.prepare(checkout, version, _DAY)
    assert (checkout / "CHANGELOG.md").read_text() == before
    assert release.current(checkout) == denseface.__version__


def test_candidates_come_before_their_release(release):
    versions = ["1.9.0", "1.10.0rc1", "1.10.0rc12", "1.10.0", "2.0.0"]
    assert sorted(versions, key=release.number) == versions


@pytest.mark.parametrize("changelog", [
    "# Changelog\n", "# Changelog\n\n## 0.1.0 - 2026-01-01\n- Old.\n",
    "# Changelog\n\n## Unreleased\n\n## 0.1.0 - 2026-01-01\n- Old.\n"])
def test_nothing_new_is_no_release(release, checkout, changelog):
    (checkout / "CHANGELOG.md").write_text(changelog)
    with pytest.raises(release.ReleaseError, match=r"CHANGELOG\.md"):
        release.prepare(checkout, "7.8.9", _DAY)
    assert release.current(checkout) == denseface.__version__


def test_the_image_recipe_is_what_the_build_needs(release):
    names = release.recipe(_ROOT)
    assert {"Dockerfile", ".dockerignore", "requirements", "denseface", "LICENSE"} <= {*names}
    assert [name for name in names if not (_ROOT / name).exists()] == []


def _filled(folder: Path, mode: int, stamp: int, names: list[str]) -> Path:
    (folder / "in").mkdir(parents=True)
    for name in names:
        path = folder / "in" / name
        path.write_text(f"content of {name}")
        path.chmod(mode)
        os.utime(path, (stamp, stamp))
    (folder / "in" / "link").symlink_to(names[0])
    return folder


def test_what_is_packed_is_the_same_bytes(archives, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    packed = []
    for at, (mode, stamp, names) in enumerate(((0o600, 1, ["a", "b"]), (0o664, 2, ["b", "a"]))):
        folder = _filled(tmp_path / str(at), mode, stamp, sorted(names))
        out = tmp_path / f"out{at}" / "thing-1.tar.gz"
        out.parent.mkdir()
        archives.pack(folder, out)
        packed.append(out)
    assert packed[0].read_bytes() == packed[1].read_bytes()
    with tarfile.open(packed[0]) as archive:
        assert [(one.name, one.mode, one.mtime, one.linkname) for one in archive] == [
            ("thing-1/in/a", 0o644, 1700000000, ""), ("thing-1/in/b", 0o644, 1700000000, ""),
            ("thing-1/in/link", 0o777, 1700000000, "a")]


def test_every_difference_of_two_builds_is_named(archives, tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    for folder, names, mode, day in ((one, "ab", 0o644, 1), (two, "ac", 0o600, 2)):
        folder.mkdir()
        with tarfile.open(folder / "s.tar.gz", "w:gz") as archive:
            for name in names:
                member = tarfile.TarInfo(name)
                member.mode, member.mtime = mode, day
                archive.addfile(member)
        with zipfile.ZipFile(folder / "w.whl", "w") as archive:
            archive.writestr(zipfile.ZipInfo("x", (2020, 1, day, 0, 0, 0)), names)
        with zipfile.ZipFile(folder / "o.whl", "w") as archive:
            for name in (names[0], "z") if day == 1 else ("z", names[0]):
                archive.writestr(zipfile.ZipInfo(name), "")
        (folder / "same").write_text("same")
        (folder / f"only{day}").touch()
        (folder / "text").write_text(names)
    digests = [hashlib.sha256(text.encode()).hexdigest()[:12] for text in ("ab", "ac")]
    assert sorted(archives.differences(one, two)) == [
        "o.whl: the same members in another order",
        f"only1: only in {one}", f"only2: only in {two}",
        "s.tar.gz: a: mode 0o644 and 0o600", "s.tar.gz: a: time 1 and 2",
        f"s.tar.gz: b: only in {one / 's.tar.gz'}", f"s.tar.gz: c: only in {two / 's.tar.gz'}",
        "text: other bytes", f"w.whl: x: content {digests[0]} and {digests[1]}",
        "w.whl: x: time (2020, 1, 1, 0, 0, 0) and (2020, 1, 2, 0, 0, 0)"]
    assert archives.differences(one, one) == []


def test_the_whole_is_built_to_the_same_bytes(archives, tmp_path):
    """The core is, with all of its code, in `test_packaging`."""
    for mask in ("022", "077"):
        source = tmp_path / mask / "whole"
        built = subprocess.run(
            ["sh", "-euc", 'umask "$1"; mkdir -p "$2"; cp "$3"/* "$2"; cd "$2"\n'
             'exec "$4" -m hatchling build -d ../dist', "sh", mask, source,
             _ROOT / "distributions" / "whole", sys.executable],
            check=False, capture_output=True, text=True, timeout=LIMIT_S,
            env=os.environ | {"SOURCE_DATE_EPOCH": "1700000000", "HOME": str(source.parent)})
        assert built.returncode == 0, built.stderr
    assert len(list((tmp_path / "022" / "dist").iterdir())) == 2
    assert archives.differences(tmp_path / "022" / "dist", tmp_path / "077" / "dist") == []


@pytest.mark.parametrize("path", _WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_runs_what_there_is_with_few_rights(path):
    yaml = pytest.importorskip("yaml")
    text = path.read_text()
    workflow = yaml.safe_load(text)
    assert workflow["permissions"] == {"contents": "read"}
    steps = [step for job in workflow["jobs"].values() for step in job["steps"]]
    run = "\n".join(step.get("run", "") for step in steps)
    scripts = re.findall(r"(?:script|\.ci)/\w+", run)
    assert scripts
    for name in scripts:
        assert os.access(_ROOT / name, os.X_OK), name
    for script, part in re.findall(r"script/(dist|release) (\w+)", run):
        usage = (_ROOT / "script" / script).read_text()
        assert re.search(rf"^(# *|    )script/{script} {part}\b", usage, re.M), (script, part)
    # What somebody else chooses (a tag's name) is never pasted into a shell's text.
    assert "${{" not in run
    used = re.findall(r"uses: (.*)", text)
    assert used
    for one in used:
        assert re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", one), one


def test_the_workflow_tries_every_python_that_is_promised():
    yaml = pytest.importorskip("yaml")
    workflow = yaml.safe_load((_ROOT / ".github" / "workflows" / "ci.yml").read_text())
    project = tomllib.loads((_ROOT / "pyproject.toml").read_text())["project"]
    promised = [one.rpartition(" ")[2] for one in project["classifiers"]
                if re.fullmatch(r"Programming Language :: Python :: 3\.\d+", one)]
    assert workflow["jobs"]["install"]["strategy"]["matrix"]["python"] == promised


def test_both_distributions_have_the_command_and_the_licence():
    core, whole = (tomllib.loads((_ROOT / f"distributions/{name}/pyproject.toml").read_text())
                   for name in ("core", "whole"))
    assert core["project"]["scripts"] == whole["project"]["scripts"]
    licence = (_ROOT / "LICENSE").read_bytes()
    for name in ("core", "whole"):
        assert (_ROOT / f"distributions/{name}/LICENSE").read_bytes() == licence
    assert not (_ROOT / "distributions/whole/LICENSE").is_symlink()
