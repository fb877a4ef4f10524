"""Folders for compiled code, and whether what is in them may be run.

Code is kept as pickles, so who can write one can run anything here. It is taken from, and put into,
folders alone that belong to this user, to root, or to whom the code's own source belongs, and that
nobody else can write.
"""

import grp
import hashlib
import os
import pwd
import stat
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from numba.core import config

__all__ = ["folders_for", "why_not_trusted", "why_not_writable"]


def folders_for(source: Path) -> Iterator[Path]:
    """Give the folders that may hold the code of a source file, in the order of looking.

    - that of `NUMBA_CACHE_DIR`
    - `__pycache__` beside the source: an installation that cannot be written may hold what was
      compiled when it was made
    - the user's cache folder: `$XDG_CACHE_HOME/denseface` or `~/.cache/denseface`
    - a private folder in `$TMPDIR` or `/tmp`
    """
    own = f"{source.parent.name}_{hashlib.sha256(bytes(source.parent)).hexdigest()[:16]}"
    if chosen := getattr(config, "CACHE_DIR", ""):
        yield Path(chosen).absolute() / own
    yield source.parent / "__pycache__"
    for root in _private_folders():
        yield root / own


def why_not_trusted(folder: Path, source: Path, *files: Path) -> str:
    """Say why another user might have put into a folder what is there; empty where none can.

    Parameters
    ----------
    source : whose code is in the folder, perhaps in `files` there

    Raises
    ------
    OSError
        Where something is not there, or may not be looked at.
    """
    trusted = {0, os.geteuid()}
    if folder == source.parent / "__pycache__":
        trusted.add(source.stat().st_uid)  # that user's code runs here already
    for one in (folder, folder.parent, *files):
        status = one.stat()
        if status.st_uid not in trusted:
            return f"{one} belongs to another user"
        if _others_write(status):
            return f"{one} can be written by others"
    for above in folder.resolve().parents:
        mode = above.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"{above} can be written by others"
    return ""


def why_not_writable(folder: Path, source: Path) -> str:
    """Make a folder for code where there is none; say why nothing may be put there."""
    try:
        _make(folder)
        reason = why_not_trusted(folder, source)
    except OSError as error:
        return f"{error.filename or folder}: {error.strerror}"
    if not reason and not os.access(folder, os.W_OK | os.X_OK):
        reason = f"{folder} cannot be written"
    return reason


def _private_folders() -> Iterator[Path]:
    """Give those that are made for this user alone."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    if home.is_absolute():  # it is not where the user has no home
        yield home / "denseface"
    yield Path(os.environ.get("TMPDIR") or "/tmp") / f"denseface-{os.geteuid()}"  # noqa: S108


def _make(folder: Path) -> None:
    if folder.is_dir():
        return
    if folder.parent in _private_folders():
        home = folder.parent.parent
        if home.parent.is_dir():  # no home is made where there is none
            home.mkdir(mode=0o700, exist_ok=True)
        folder.parent.mkdir(mode=0o700, exist_ok=True)
    folder.mkdir(mode=0o755, exist_ok=True)


def _others_write(status: os.stat_result) -> bool:
    mode = status.st_mode
    return bool(mode & stat.S_IWOTH or (mode & stat.S_IWGRP and not _is_own_group(status.st_gid)))


@cache
def _is_own_group(group_id: int) -> bool:
    """Say whether a group is the user's alone, as many systems give each user one."""
    try:
        user, group = pwd.getpwuid(os.geteuid()), grp.getgrgid(group_id)
    except KeyError:
        return False
    return (group_id == user.pw_gid and group.gr_name == user.pw_name
            and set(group.gr_mem) <= {user.pw_name})
