"""Why there is no hub at an address, as far as this machine can tell."""

import errno
import os
import pwd
import socket
import stat
from pathlib import Path

from denseface.service.errors import AddressError, reason_of

__all__ = ["check_openable", "why_absent"]

_START = "is `denseface up` running?"


def check_openable(address: str, path: Path) -> None:
    """Refuse a socket's file that this user may not open: waiting would not help.

    AddressError, which names whose it is. A file that is not there yet is none of those.
    """
    if why := _why_locked(path):
        raise AddressError(
            f"{address}: {why}: a socket file is for its own user alone; `denseface up` starts a "
            "hub of your own, and one with --listen lets others in, with keys")


def why_absent(path: Path | None) -> str:
    """Say why nobody answers at the socket's file of an `ipc` address, or at another one (None)."""
    if path is None:
        return f"nothing answers there, or the network does not let it through; {_START}"
    if why := _why_locked(path):
        return why
    try:
        if not stat.S_ISSOCK(path.stat().st_mode):
            return "there is a file of that name, and it is no socket"
        with socket.socket(socket.AF_UNIX) as probe:
            probe.setblocking(False)
            probe.connect(str(path))
    except (FileNotFoundError, NotADirectoryError):
        return f"there is no such socket file; {_START}"
    except ConnectionRefusedError:
        return f"the socket file is left of a hub that has ended; {_START}"
    except OSError as error:
        return f"{reason_of(error)}; {_START}"
    return "something listens there and does not answer as a hub does"


def _why_locked(path: Path) -> str | None:
    """Say whose a file is that this user may not open; None where they may, or it is not there."""
    for one in (path, *path.parents):
        try:
            found = one.stat()
        except PermissionError:
            continue  # a folder above it is closed
        except OSError as error:
            return None if error.errno in (errno.ENOENT, errno.ENOTDIR) else reason_of(error)
        if one is path and os.access(path, os.W_OK):
            return None
        return (f"permission denied: {one} belongs to {_name_of(found.st_uid)} "
                f"(mode {stat.S_IMODE(found.st_mode):o})")
    return None


def _name_of(uid: int) -> str:
    try:
        return f"the user {pwd.getpwuid(uid).pw_name}"
    except KeyError:
        return f"the user number {uid}"
