"""What each extra of denseface-core brings along, as it is installed here."""

import importlib.metadata
import itertools
import subprocess
import sys
import tomllib
from pathlib import Path

from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

REPOSITORY = Path(__file__).resolve().parents[1]
CHECKOUT, CORE, WHOLE = (
    tomllib.loads((REPOSITORY / folder / "pyproject.toml").read_text())["project"]
    for folder in ("", "distributions/core", "distributions/whole"))


def required(*extras: str) -> set[str]:
    """Give the packages that an installation with these extras has, beside denseface-core."""
    asked = [*CORE["dependencies"], *itertools.chain.from_iterable(
        CORE["optional-dependencies"][extra] for extra in extras)]
    found: set[str] = set()
    for one in map(Requirement, asked):
        if one.name == CORE["name"]:
            found |= required(*one.extras)
        elif _applies(one, ""):
            found |= _with_its_own(one, found)
    return found


def top_modules(packages: set[str]) -> set[str]:
    """Give the names in `site-packages` that packages have."""
    found: set[str] = set()
    for package in packages:
        files = importlib.metadata.distribution(package).files or ()
        found |= {file.parts[0].removesuffix(".py") for file in files}
    return found - {"..", "__pycache__"}


def run_with(
    packages: set[str], code: str, *arguments: object, folder: Path = REPOSITORY,
) -> subprocess.Popen[str]:
    """Run Python on the `denseface` of a folder where these packages alone can be imported."""
    known = top_modules(packages) | set(sys.stdlib_module_names) | {"denseface"}
    return subprocess.Popen(
        [sys.executable, "-c", f"known = {known!r}\n{_REFUSE}{code}", *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder)


_REFUSE = """\
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in known and not name.startswith("_sysconfigdata"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Refuse())
"""


def _with_its_own(asked: Requirement, known: set[str]) -> set[str]:
    name = canonicalize_name(asked.name)
    found = {name}
    for extra in ("", *asked.extras):
        for one in map(Requirement, importlib.metadata.requires(name) or ()):
            if _applies(one, extra) and canonicalize_name(one.name) not in known | found:
                found |= _with_its_own(one, known | found)
    return found


def _applies(asked: Requirement, extra: str) -> bool:
    here = {name: str(value) for name, value in default_environment().items()}
    return asked.marker is None or asked.marker.evaluate(here | {"extra": extra})
