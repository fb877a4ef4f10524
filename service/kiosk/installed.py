"""Whether the kiosk can run here: it needs an extra of the package, and the built page."""

from importlib.util import find_spec
from pathlib import Path

__all__ = ["LANGUAGES", "STATIC", "why_not"]

STATIC = Path(__file__).parent / "static"
"""Folder of the built page."""
LANGUAGES = Path(__file__).parent / "languages"
"""Folder of the texts, a file for each language."""
_PACKAGES = ("starlette", "uvicorn", "websockets")


def why_not(what: str = "kiosk") -> str | None:
    """Say in one line what is missing for a page, called `what`; None where nothing is."""
    if missing := [name for name in _PACKAGES if find_spec(name) is None]:
        return (f"no {what}: {missing[0]} is not installed; pip install 'denseface-core[kiosk]' "
                "brings what it needs")
    if not (STATIC / "kiosk.js").is_file():
        return (f"no {what}: its page is not built; npm ci --ignore-scripts && node build.mjs in "
                "service/kiosk/frontend builds it")
    return None
