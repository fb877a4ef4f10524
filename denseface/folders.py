"""Where a user's files are: the XDG Base Directory Specification, version 0.8."""

import os
from pathlib import Path
from typing import Literal

__all__ = ["user_folder"]

_DEFAULTS = {"config": ".config", "data": ".local/share", "state": ".local/state"}
"""Kind of files -> folder below the home directory."""


def user_folder(kind: Literal["config", "data", "state"]) -> Path:
    """Give the folder of this program's files of a kind; it is not made.

    `$XDG_CONFIG_HOME/denseface` and so on. A path that is not absolute is as none there.
    """
    given = os.environ.get(f"XDG_{kind.upper()}_HOME", "")
    base = Path(given) if given.startswith("/") else Path.home() / _DEFAULTS[kind]
    return base / "denseface"
