"""The service's log, from wherever it goes: the journal, a file, or else this process's memory."""

import os
import re
import stat
import subprocess
from collections.abc import Mapping

from denseface.service.log.output import process_log

__all__ = ["keep_lines", "recent_log"]

_MAX_BYTES = 2**20
"""Of a log that is given."""
_MAX_LINES = 2000
_JOURNAL_S = 10.0
"""Longest time for the journal to answer, seconds."""
_STDERR = 2
_COLORS = re.compile(rb"\x1b\[[0-9;]*m")
"""As a log on a terminal has them."""


def keep_lines() -> None:
    """Keep the last lines of this process's log from now on."""
    process_log.keep(_MAX_LINES)


def recent_log(environment: Mapping[str, str] = os.environ, stderr: int = _STDERR) -> bytes:
    """Give the last lines of the log, at most a mebibyte; waits for the disk or the journal.

    Of all processes where stderr is a file, or the journal of the unit that this process is of;
    else of this process alone.
    """
    lines = _of_journal(environment) or _of_file(stderr) or b"".join(process_log.kept)
    return _COLORS.sub(b"", lines[-_MAX_BYTES:])


def _of_journal(environment: Mapping[str, str]) -> bytes:
    invocation = environment.get("INVOCATION_ID", "")
    if "JOURNAL_STREAM" not in environment or not invocation.isalnum():
        return b""
    try:
        return subprocess.run(
            ["journalctl", "--no-pager", "--output=cat", f"--lines={_MAX_LINES}",
             f"_SYSTEMD_INVOCATION_ID={invocation}"],
            check=False, capture_output=True, timeout=_JOURNAL_S).stdout
    except (OSError, subprocess.TimeoutExpired):
        return b""


def _of_file(descriptor: int) -> bytes:
    """Read the end of the file behind a descriptor, which may be open for writing alone."""
    try:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode):
            return b""
        with open(f"/proc/self/fd/{descriptor}", "rb") as file:  # noqa: PTH123  (no path of a file)
            file.seek(max(0, found.st_size - _MAX_BYTES))
            lines = file.read(_MAX_BYTES)
    except OSError:
        return b""
    return lines if found.st_size <= _MAX_BYTES else lines.partition(b"\n")[2]
