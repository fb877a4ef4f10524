"""Wheels of the lock for a machine, as a table; script/wheels runs this."""

import argparse
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from packaging.tags import Tag, compatible_tags, cpython_tags
from packaging.utils import parse_wheel_filename

_ROOT = Path(__file__).resolve().parents[1]
_LOCK = _ROOT / "requirements" / "run.txt"
_CORE = _ROOT / "distributions" / "core" / "pyproject.toml"
_KIOSK = ("hub", "worker", "capture", "kiosk")
"""Extras of a machine that is all of a kiosk."""
_FROM_SOURCE = {"primesense"}
"""Python alone, and published as source: nothing is compiled when they are installed."""
_OLDEST_GLIBC = 17
"""2.17 is that of manylinux2014, the oldest tag that is in use."""

_Packages = dict[str, dict[str, Any]]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/wheels", description=__doc__)
    parser.add_argument("--uv", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--machine", choices=("aarch64", "x86_64"), default="aarch64",
                        help="default: %(default)s")
    parser.add_argument("--glibc", default="2.36", metavar="2.N",
                        help="the oldest machine's (default: %(default)s, Debian 12)")
    parser.add_argument("--python", nargs="+", default=["3.11", "3.12", "3.13"], metavar="3.N",
                        help="default: 3.11 3.12 3.13")
    args = parser.parse_args()
    minor = _minor(parser, "--glibc", args.glibc, "2")
    pythons = [(3, _minor(parser, "--python", one, "3")) for one in args.python]
    if minor < _OLDEST_GLIBC:
        parser.error(f"--glibc: expected 2.{_OLDEST_GLIBC} or newer, found {args.glibc}")
    platform = f"{args.machine}-manylinux_2_{minor}"
    found = {python: _locked(args.uv, python, platform) for python in pythons}
    kiosk = _asked_by_core(args.uv, pythons[0], platform)
    glibcs = [f"manylinux_2_{one}_{args.machine}" for one in range(minor, 4, -1)]
    print(f"{datetime.now(UTC):%Y-%m-%d}, {args.machine}, glibc {args.glibc}; `script/wheels "
          f"{' '.join(sys.argv[3:])}`.\n".replace(" `script/wheels `", " `script/wheels`"))
    pure, missing = [], set()
    print("| package | " + " | ".join(f"Python {one}.{two}" for one, two in pythons)
          + " | a kiosk needs it |\n|" + " --- |" * (len(pythons) + 2))
    for name in sorted({name for packages in found.values() for name in packages}):
        wheels = [_best(found[python].get(name), python, glibcs) for python in pythons]
        if all(wheel is not None and wheel["name"].endswith("-none-any.whl") for wheel in wheels):
            pure.append(name)
            continue
        if any(wheel is None for wheel in wheels) and name not in _FROM_SOURCE:
            missing.add(name)
        cells = [_said(found[python].get(name), wheel, name)
                 for python, wheel in zip(pythons, wheels, strict=True)]
        print(f"| {name} | " + " | ".join(cells) + f" | {'yes' if name in kiosk else 'no'} |")
    print(f"\nFor any machine (`none-any`): {', '.join(pure)}. A kiosk needs of these "
          f"{', '.join(name for name in pure if name in kiosk)}.")
    for python in pythons:
        whole, less = (
            sum(size for name, packages in found[python].items()
                if (some is None or name in some)
                and (size := (_best(packages, python, glibcs) or {"size": 0})["size"]))
            for some in (None, kiosk))
        print(f"Python 3.{python[1]}: {_mb(whole)} MB to download in all, {_mb(less)} for a kiosk.")
    if missing:
        print(f"wheels: no wheel of {', '.join(sorted(missing))}", file=sys.stderr)
    return 1 if missing else 0


def _minor(parser: argparse.ArgumentParser, flag: str, given: str, major: str) -> int:
    head, _, minor = given.partition(".")
    if head != major or not minor.isdecimal():
        parser.error(f"{flag}: expected {major}.N, found {given}")
    return int(minor)


def _locked(uv: str, python: tuple[int, int], platform: str) -> _Packages:
    """Give what the lock installs there, with all its files."""
    return _compiled(uv, python, platform, [str(_LOCK), "--no-deps"])


def _asked_by_core(uv: str, python: tuple[int, int], platform: str) -> set[str]:
    extras = [word for extra in _KIOSK for word in ("--extra", extra)]
    return set(_compiled(uv, python, platform, [str(_CORE), *extras, "--constraint", str(_LOCK)]))


def _compiled(uv: str, python: tuple[int, int], platform: str, words: list[str]) -> _Packages:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "pylock.toml"
        done = subprocess.run(
            [uv, "pip", "compile", "--quiet", "--format", "pylock.toml", "--python-version",
             f"{python[0]}.{python[1]}", "--python-platform", platform, "--output-file", str(out),
             *words], check=False, capture_output=True, text=True, cwd=folder)
        if done.returncode:
            sys.exit(f"wheels: {done.stderr.strip()}")
        return {one["name"]: one for one in tomllib.loads(out.read_text())["packages"]}


def _tags(python: tuple[int, int], platforms: list[str]) -> Iterator[Tag]:
    yield from cpython_tags(python, platforms=platforms)
    yield from compatible_tags(python, f"cp{python[0]}{python[1]}", platforms)


def _best(
    package: dict[str, Any] | None, python: tuple[int, int], glibcs: list[str]
) -> dict[str, Any] | None:
    """Give the wheel that pip would take, with its name."""
    if package is None:
        return None
    machine = glibcs[0].partition("_2_")[2].partition("_")[2]
    platforms = [*glibcs, f"manylinux2014_{machine}", f"linux_{machine}"]
    rank = {tag: place for place, tag in reversed(list(enumerate(_tags(python, platforms))))}
    ranked = []
    for wheel in package.get("wheels", []):
        name = wheel.get("name") or wheel["url"].rpartition("/")[2]
        places = [rank[tag] for tag in parse_wheel_filename(name)[3] if tag in rank]
        if places:
            ranked.append((min(places), {**wheel, "name": name}))
    return min(ranked, key=lambda one: one[0])[1] if ranked else None


def _said(
    package: dict[str, Any] | None, wheel: dict[str, Any] | None, name: str
) -> str:
    if package is None:
        return "-"
    if wheel is None:
        return f"{package['version']}, source" + ("" if name in _FROM_SOURCE else ", **no wheel**")
    glibcs = [tag.platform.split("_")[2] for tag in parse_wheel_filename(wheel["name"])[3]
              if tag.platform.startswith("manylinux_2_")]
    oldest = min(map(int, glibcs)) if glibcs else _OLDEST_GLIBC
    return f"{package['version']}, {_mb(wheel['size'])} MB, 2.{oldest}"


def _mb(size: int) -> str:
    return f"{size / 1e6:.1f}" if size < 1e8 else f"{size / 1e6:.0f}"


if __name__ == "__main__":
    sys.exit(main())
