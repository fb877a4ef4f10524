"""Whether a press now would become a face."""

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from denseface.service.errors import reason_of
from denseface.service.monitoring.observer import Snapshot
from denseface.service.settings import ServiceSettings

__all__ = ["Health", "write_error"]

_STALL_S = 5.0
"""Age of a snapshot beyond which the hub is not healthy, seconds; or its time-out for peers."""
_MIB = 2**20


@dataclass(frozen=True)
class Health:
    """Judges the hub's last snapshot; for any thread."""

    latest: Callable[[], Snapshot | None]
    """Gives the last snapshot, None before there is one."""
    settings: ServiceSettings
    write_error: Callable[[], str | None]
    """Says why nothing can be written, None where it can."""
    clock: Callable[[], float] = time.monotonic
    """The snapshots', seconds."""

    def report(self) -> tuple[bool, dict[str, Any]]:
        """Say whether all is well, with what `/healthz` shows as JSON."""
        snapshot = self.latest()
        status = snapshot.status if snapshot else None
        missing = self._missing(snapshot)
        return not missing, {
            "healthy": not missing, "missing": missing,
            "version": status.hub_version if status else None,
            "sensors": len(status.sensors) if status else 0,
            "workers": len(status.workers) if status else 0}

    def _missing(self, snapshot: Snapshot | None) -> list[str]:
        found = []
        if snapshot is None:
            found.append("hub: has not said how it is yet")
        elif (silence := self.clock() - snapshot.taken) > max(_STALL_S, self.settings.silence_s):
            found.append(f"hub: has not said how it is for {silence:.0f} s")
        if why := self.write_error():
            found.append(f"store: {why}")
        if snapshot is None:
            return found
        found += [f"hub: nobody can connect: {why}" for why in snapshot.unreachable]
        status, reserve = snapshot.status, self.settings.reserve_mib
        if status.free_bytes is None:
            found.append("disk: its free room is not known")
        elif status.free_bytes < reserve * _MIB:
            found.append(
                f"disk: {status.free_bytes // _MIB} MiB free, {reserve} MiB are to stay free")
        if not status.has_frames:
            found += [f"sensor: {one.name} is {one.state}{one.reason and f': {one.reason}'}"
                      for one in status.sensor_states] or ["sensor: none is alive"]
        if not status.workers:
            found.append(f"worker: {status.kernels or 'none is alive'}")
        return found


def write_error(folder: Path) -> str | None:
    """Try to write into a folder, leaving no file; give what the system says where that fails."""
    try:
        # Without a name where the file system knows O_TMPFILE; elsewhere it is unlinked at once.
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(4096))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        return f"{folder}: {reason_of(error)}"
    return None
