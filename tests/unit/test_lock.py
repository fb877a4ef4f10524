"""requirements/*.txt, which script/lock makes, fit what pyproject.toml asks for."""

import importlib.metadata
import itertools
import re
import tomllib
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from denseface.service.runtime.process import TRIED_PYTHONS

_REPOSITORY = Path(__file__).resolve().parents[2]
_FOLDER = _REPOSITORY / "requirements"
_PROJECT = tomllib.loads((_REPOSITORY / "pyproject.toml").read_text())
(_MAJOR, _FIRST), (_, _LAST) = TRIED_PYTHONS
_PYTHONS = [f"{_MAJOR}.{minor}" for minor in range(_FIRST, _LAST + 1)]
_PLATFORMS = [
    {"python_version": python, "python_full_version": f"{python}.0", "sys_platform": "linux",
     "platform_system": "Linux", "os_name": "posix", "platform_machine": machine,
     "implementation_name": "cpython", "platform_python_implementation": "CPython"}
    for python, machine in itertools.product(_PYTHONS, ("x86_64", "aarch64"))]


def _lines(name: str) -> list[str]:
    """Give the requirements of a file, each on one line, without comments."""
    text = (_FOLDER / name).read_text().replace("\\\n", " ")
    return [line for line in text.splitlines() if line and not line.lstrip().startswith("#")]


def _applies(requirement: Requirement, platform: dict[str, str]) -> bool:
    return requirement.marker is None or requirement.marker.evaluate({"extra": "", **platform})


def _pins(lock: str, platform: dict[str, str]) -> dict[str, str]:
    """Give the version of each package that a lock installs on a platform."""
    found: dict[str, str] = {}
    for line in _lines(f"{lock}.txt"):
        pin = Requirement(line.partition(" --hash")[0])
        if _applies(pin, platform):
            name = canonicalize_name(pin.name)
            assert name not in found
            only, = pin.specifier
            assert only.operator == "=="
            found[name] = only.version
    return found


def _unmet(requirements: list[str], pins: dict[str, str], platform: dict[str, str]) -> list[str]:
    def is_met(requirement: Requirement) -> bool:
        version = pins.get(canonicalize_name(requirement.name))
        return version is not None and requirement.specifier.contains(version, prereleases=True)

    return [str(one) for one in map(Requirement, requirements)
            if _applies(one, platform) and not is_met(one)]


def test_the_package_is_for_the_pythons_that_were_tried():
    assert _PROJECT["project"]["requires-python"] == f">={_MAJOR}.{_FIRST},<{_MAJOR}.{_LAST + 1}"
    start = "Programming Language :: Python :: 3."
    assert [one.removeprefix(start[:-2]) for one in _PROJECT["project"]["classifiers"]
            if one.startswith(start)] == _PYTHONS


_NAME = _PROJECT["project"]["name"]
_EXTRAS = _PROJECT["project"]["optional-dependencies"]


def _of(*extras: str) -> list[str]:
    """Give what extras require, also by extras that they name."""
    found = []
    for one in itertools.chain.from_iterable(_EXTRAS[extra] for extra in extras):
        named = Requirement(one)
        found += _of(*sorted(named.extras)) if named.name == _NAME else [one]
    return found


_RUN = _PROJECT["project"]["dependencies"] + _of("all", "kiosk")
_DEV = _of("dev", "batch", "notebook", "rerun", "docs")
_IMAGE = _of("capture", "completion", "hub", "kiosk", "worker") + [
    one for one in _PROJECT["project"]["dependencies"]
    if Requirement(one).name in ("numpy", "pydantic", "pyzmq")]
_BUILD = [*_PROJECT["build-system"]["requires"], *_lines("build.in")]


@pytest.mark.parametrize("platform", _PLATFORMS, ids=lambda one: "-".join(
    one[key] for key in ("python_version", "platform_machine")))
@pytest.mark.parametrize(("lock", "requirements"), [
    ("run", _RUN), ("image", _IMAGE), ("dev", _RUN + _DEV + _BUILD), ("build", _BUILD),
    ("tools", _lines("tools.in"))], ids=lambda one: one if isinstance(one, str) else "")
def test_every_requirement_is_met(lock, requirements, platform):
    assert not _unmet(requirements, _pins(lock, platform), platform)


def test_every_extra_is_locked():
    assert {*_RUN, *_DEV} == {*_PROJECT["project"]["dependencies"], *_of(*_EXTRAS)}


@pytest.mark.parametrize("platform", _PLATFORMS, ids=str)
def test_what_is_deployed_is_what_is_tested(platform):
    tested = _pins("dev", platform).items()
    assert _pins("run", platform).items() <= tested
    assert _pins("build", platform).items() <= tested
    image = _pins("image", platform)
    assert image.items() <= _pins("run", platform).items()
    # By far the largest, and nothing that the service runs imports it.
    assert not {"open3d", "open3d-cpu", "matplotlib", "pandas"} & image.keys()


def test_what_installed_packages_require_is_locked_too():
    here = {name: str(value) for name, value in default_environment().items()}
    pins = _pins("dev", here)
    asked = {}
    for name, version in pins.items():
        try:
            there = importlib.metadata.distribution(name)
        except importlib.metadata.PackageNotFoundError:
            continue
        if there.version == version:
            asked[name] = _unmet(there.requires or [], pins, here)
    assert len(asked) > 50
    assert not {name: unmet for name, unmet in asked.items() if unmet}


@pytest.mark.parametrize("lock", ["build", "dev", "image", "run", "tools"])
def test_every_pin_has_hashes_and_no_address(lock):
    for line in _lines(f"{lock}.txt"):
        assert re.fullmatch(r"[\w.-]+==[\w.+!-]+( ; [^-]+)?( +--hash=sha256:[0-9a-f]{64})+", line)
    assert "://" not in (_FOLDER / f"{lock}.txt").read_text()
