"""The program that units start: where it is, and what of it a service would not see by itself."""

import os
import site
import stat
import sys
from dataclasses import dataclass
from pathlib import Path

import denseface
from denseface.service.errors import UsageError

__all__ = ["Program", "as_word", "find_program"]

_HOMES = tuple(map(Path, ("/home", "/root", "/run/user")))
"""What `ProtectHome` hides."""
_TEMPORARY = tuple(map(Path, ("/tmp", "/var/tmp")))  # noqa: S108
"""What `PrivateTmp` hides."""
_ELSEWHERE = "install denseface elsewhere, as by python3 -m venv /opt/denseface"
_ENTER = stat.S_IROTH | stat.S_IXOTH
_PLAIN = frozenset("/._+@-,=~")
"""Characters of a word that needs no quotes, with letters and digits."""
_REFUSED = frozenset("\"'\\")


@dataclass(frozen=True)
class Program:
    """How a unit starts `denseface`."""

    command: str
    """As `ExecStart` has it; the subcommand follows."""
    homes: tuple[str, ...] = ()
    """Folders below what `ProtectHome` hides, as `BindReadOnlyPaths` has them."""


def find_program(*, sandboxed: bool) -> Program:
    """Find the installation that runs now.

    Parameters
    ----------
    sandboxed : whether it is to be used by services of another user, which see no home folders

    Raises
    ------
    UsageError
        Where these could not use it.
    """
    script = Path(sys.executable).with_name("denseface")
    words = [str(script)] if os.access(script, os.X_OK) else [sys.executable, "-P", "-m",
                                                              "denseface"]
    command = " ".join(map(as_word, words))
    if not sandboxed:
        return Program(command)
    package = Path(denseface.__file__).resolve().parent
    if package.is_relative_to(site.getusersitepackages()):
        raise UsageError(f"{package}: installed for one user alone, by pip install --user, and "
                         f"services have another: {_ELSEWHERE}, or use --user")
    needed = {Path(os.path.abspath(one)) for one in (sys.prefix, sys.base_prefix)}  # noqa: PTH100
    if not any(package.is_relative_to(one.resolve()) for one in needed):
        needed.add(package.parent)  # a checkout
    folders = sorted(needed | {one.resolve() for one in needed})
    for one in folders:
        _check_seen(one)
    homes = tuple(str(one) for one in folders if _home_of(one))
    for name in homes:
        if not _is_plain(name):  # spaces and colons separate such paths, whatever is quoted
            raise UsageError(f"{name}: only a path of letters, digits and "
                             f"{''.join(sorted(_PLAIN))} can be shown to services: {_ELSEWHERE}")
    return Program(command, homes)


def as_word(text: str) -> str:
    """Write the path of a program as one word of a unit's line, see systemd.syntax(7).

    Raises
    ------
    UsageError
        Where it has control characters, quotes or a backslash, as systemd has no program so named.
    """
    if not text.isprintable() or not _REFUSED.isdisjoint(text):
        raise UsageError(f"{text!r}: systemd starts no program with such characters in its path: "
                         f"{_ELSEWHERE}")
    return text if _is_plain(text) else '"' + text.replace("%", "%%") + '"'


def _is_plain(text: str) -> bool:
    return all((one.isascii() and one.isalnum()) or one in _PLAIN for one in text)


def _home_of(folder: Path) -> Path | None:
    return next((one for one in _HOMES if folder.is_relative_to(one)), None)


def _check_seen(folder: Path) -> None:
    """Refuse a folder that a service of another user would not see, or may not read."""
    if any(folder.is_relative_to(one) for one in _TEMPORARY):
        raise UsageError(f"{folder}: services have temporary folders of their own and would not "
                         f"see it: {_ELSEWHERE}")
    # What is above a folder of a home is made anew for the service, and can be entered.
    for one in (folder,) if _home_of(folder) else (folder, *folder.parents):
        wanted = _ENTER if one == folder else stat.S_IXOTH
        if one.stat().st_mode & wanted != wanted:
            raise UsageError(f"{one}: other users may not enter this folder, and services have one "
                             f"of their own: chmod o+rx {one}, or {_ELSEWHERE}")
