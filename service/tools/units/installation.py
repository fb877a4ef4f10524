"""What `denseface install-units` does: shows, writes and removes units; systemd reads them."""

import os
import shutil
import subprocess
from pathlib import Path

from denseface.folders import user_folder
from denseface.service.errors import UsageError, reason_of
from denseface.service.runtime.terminal import complain, say, suggest
from denseface.service.tools.units import files
from denseface.service.tools.units.program import Program, find_program
from denseface.service.tools.units.rendering import INSTANCES, TARGET, Choice, render

__all__ = ["install", "show", "uninstall"]

_SYSTEM = Path("/etc/systemd/system")
_BOOTED = Path("/run/systemd/system")
"""There where systemd runs, see sd_booted(3)."""
_SYSTEMCTL_S = 60.0
"""Longest time for systemd to answer, seconds; it stops what runs."""


def show(choice: Choice, folder: Path | None) -> int:
    """Print what would be written, and what is to be typed then; write nothing."""
    place = folder or _folder(user=choice.user)
    for name, text in render(choice, find_program(sandboxed=not choice.user)).items():
        say(f"# {place / name}", *text.splitlines(), "")
    say(*(f"# {line}" for line in _next(user=choice.user)))
    return 0


def install(choice: Choice, folder: Path | None, *, force: bool) -> int:
    """Write the units and have systemd read them; give the exit status.

    Parameters
    ----------
    folder : where to; None for systemd's own folder

    Raises
    ------
    UsageError
        Where there is no systemd, a file there is not ours to overwrite, or cannot be written.
    """
    units = render(choice, find_program(sandboxed=not choice.user))
    place = folder or _own_folder(user=choice.user)
    if not force:
        files.check_ours(place / name for name in units)
    try:
        place.mkdir(parents=True, exist_ok=True)
        written = files.write(place, units)
    except OSError as error:
        raise _unwritable(place, error, user=choice.user) from error
    say(*map(str, written))
    if not written:
        say(f"{place}: the units are as they would be written")
    if folder is not None:
        return 0
    if not _systemctl(choice.user, "daemon-reload"):
        return 1
    for line in _next(user=choice.user):
        suggest(line)
    return 0


def uninstall(choice: Choice, folder: Path | None, *, force: bool) -> int:
    """Stop what the units started and remove them, and nothing else; give the exit status.

    Raises
    ------
    UsageError
        Where a file was changed, is not ours, or cannot be removed.
    """
    place = folder or _own_folder(user=choice.user)
    paths = [place / name for name in render(choice, Program(""))]
    if not force:
        files.check_ours(paths)
    enabled = [name for name in (TARGET, *INSTANCES) if (place / name).exists()]
    if enabled and folder is None and not (
            _systemctl(choice.user, "stop", *(name for name in enabled if name == TARGET))
            and _systemctl(choice.user, "disable", "--quiet", *enabled)):
        return 1
    try:
        removed = files.remove(paths)
    except OSError as error:
        raise _unwritable(place, error, user=choice.user) from error
    say(*map(str, removed))
    if not removed:
        say(f"{place}: there are no units of denseface")
    elif folder is None and not _systemctl(choice.user, "daemon-reload"):
        return 1
    return 0


def _folder(*, user: bool) -> Path:
    if not user:
        return _SYSTEM
    return user_folder("config").parent / "systemd/user"


def _own_folder(*, user: bool) -> Path:
    """Give the folder that systemd reads; UsageError where there is no systemd."""
    if shutil.which("systemctl") is None or not _BOOTED.is_dir():
        raise UsageError("systemd does not run here: --dry-run shows the units, --folder DIR "
                         "writes them for another machine")
    return _folder(user=user)


def _unwritable(place: Path, error: OSError, *, user: bool) -> UsageError:
    hint = "" if user or os.geteuid() == 0 else ": root may, or --user, for yourself alone"
    return UsageError(f"{error.filename or place}: {reason_of(error)}{hint}")


def _systemctl(user: bool, *arguments: str) -> bool:
    """Ask systemd for something; where it is not done, say why and give False."""
    command = ["systemctl", *(["--user"] if user else []), *arguments]
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True,
                              timeout=_SYSTEMCTL_S, stdin=subprocess.DEVNULL)
        why = done.stderr if done.returncode else ""
    except (OSError, subprocess.TimeoutExpired) as error:
        why = str(error)
    if why:
        complain(f"denseface install-units: {' '.join(command)}: {' '.join(why.split())}")
    return not why


def _next(*, user: bool) -> list[str]:
    if user:
        return [f"systemctl --user enable --now {TARGET}", "loginctl enable-linger"]
    return [f"systemctl enable --now {TARGET}"]
