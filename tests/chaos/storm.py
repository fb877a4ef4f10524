"""Random faults, one after the other, from a seed."""

import errno
import random
import signal
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from denseface.service.runtime.failpoints import FAILPOINT_NAMES
from denseface.service.storage import FolderLayout
from tests.chaos.cluster import Child, Part
from tests.chaos.scene import Scene

__all__ = ["Storm", "random_actions"]

_MEAN_PAUSE_S = 0.4
_SUPERVISED_PAUSE_S = 1.5
"""There a process starts from nothing, and the service ends where one ends too often."""
_LONGEST_STOP_S = 1.5
"""Beyond the liveness of `tests.chaos.cluster.PACE`."""
_LONGEST_STALL_S = 3.0
_DISK_RUNS = (1, 2, 3, 4, 6, 20)
"""Numbers of file operations that fail one after another."""
_DISK = ("written", "synced", "renamed")


def random_actions(source: random.Random) -> dict[str, str]:
    """Draw what each failpoint does in this run."""
    actions = {}
    for name in FAILPOINT_NAMES:
        possible = ["kill", "kill", "stop"]
        if name.endswith(_DISK):
            possible += ["raise:ENOSPC", "raise:EIO"]
        if name == "worker.job.computing":
            possible.append("hang")
        actions[name] = source.choice(possible)
    return actions


class Storm(threading.Thread):
    """Does harm until `calm` is called.

    Parameters
    ----------
    actions : what the failpoints do, for the counts
    spoil : spoil files on the disk too, which may cost a frame
    """

    def __init__(
        self, scene: Scene, source: random.Random, actions: dict[str, str], *, spoil: bool
    ) -> None:
        super().__init__(daemon=True)
        self.counts: Counter[str] = Counter()
        self.error: BaseException | None = None
        self._scene = scene
        self._random = source
        self._actions = actions
        self._asked: set[str] = set()
        self._over = threading.Event()
        self._harms: list[Callable[[], None]] = [
            self._kill, self._kill, self._terminate, self._stop, self._failpoint, self._failpoint,
            self._failpoint, self._new_subscriber, self._stall_log]
        if spoil:
            self._harms.append(self._spoil)
        if scene.cluster.supervised:
            self._harms += [self._hang, self._hang]
        if scene.cluster.disk_order:
            self._harms += [self._fail_disk, self._fail_disk]
        self._pause_s = _SUPERVISED_PAUSE_S if scene.cluster.supervised else _MEAN_PAUSE_S

    def run(self) -> None:
        """Choose a harm, do it, wait a little."""
        try:
            while not self._over.wait(self._random.expovariate(1 / self._pause_s)):
                self._random.choice(self._harms)()
                self._count_failpoints()
        except BaseException as error:
            self.error = error

    def calm(self) -> None:
        """End, and let everyone run."""
        self._over.set()
        self.join()
        self._count_failpoints()
        for name in self._asked:
            self._scene.cluster.token(name).unlink(missing_ok=True)
        if self._scene.cluster.disk_order:
            self._scene.cluster.disk_order.unlink(missing_ok=True)
        for part in self._scene.cluster.parts:
            part.send(signal.SIGCONT)
        if self.error:
            raise self.error

    def _part(self) -> Part | Child:
        return self._random.choice(self._scene.cluster.victims())

    def _kill(self) -> None:
        part = self._part()
        if part.send(signal.SIGKILL):
            self.counts[f"SIGKILL to a {_kind(part)}"] += 1

    def _terminate(self) -> None:
        part = self._part()
        if part.send(signal.SIGTERM):
            self.counts[f"SIGTERM to a {_kind(part)}"] += 1

    def _stop(self) -> None:
        part = self._part()
        if part.send(signal.SIGSTOP):
            self.counts[f"SIGSTOP of a {_kind(part)}, then SIGCONT"] += 1
            self._over.wait(self._random.uniform(0.1, _LONGEST_STOP_S))
            part.send(signal.SIGCONT)

    def _hang(self) -> None:
        """Stop a process for good: who supervises it has to notice."""
        part = self._part()
        if isinstance(part, Child) and part.send(signal.SIGSTOP):
            self.counts[f"SIGSTOP of a {_kind(part)}, for good"] += 1

    def _failpoint(self) -> None:
        name = self._random.choice(FAILPOINT_NAMES)
        if name not in self._asked:
            self._asked.add(name)
            self._scene.cluster.let_fail(name)

    def _fail_disk(self) -> None:
        """Let the hub's next file operations fail, SQLite's too."""
        order = self._scene.cluster.disk_order
        if order and not order.exists():
            error = self._random.choice((errno.EIO, errno.ENOSPC))
            self._scene.cluster.fail_disk(error, self._random.choice(_DISK_RUNS))
            self.counts[f"disk: a run of {errno.errorcode[error]}"] += 1

    def _stall_log(self) -> None:
        """Stop reading what the hub logs, longer than its few lines last in the pipe."""
        log = self._scene.cluster.hub_log
        log.stall()
        # The other harms go on meanwhile.
        later = threading.Timer(self._random.uniform(0.5, _LONGEST_STALL_S), log.flow)
        later.daemon = True
        later.start()
        self.counts["the hub's log stalled"] += 1

    def _new_subscriber(self) -> None:
        self._scene.follower.restart()
        self.counts["subscriber restarted"] += 1

    def _spoil(self) -> None:
        """Spoil one file while there is no hub, as a disk would."""
        hub = self._scene.cluster.hub
        hub.end(signal.SIGKILL)
        try:
            layout = FolderLayout(self._scene.cluster.data)
            listing = layout.listing()
            files = [*((one, layout.frame(one)) for one in listing.frames),
                     *((one, layout.faces / name) for one, name in listing.faces)]
            if files:
                capture_id, path = self._random.choice(files)
                self._scene.damaged.add(capture_id)
                self._spoil_file(path)
        finally:
            hub.wanted = True

    def _spoil_file(self, path: Path) -> None:
        size = path.stat().st_size
        at = self._random.randrange(size)
        how = self._random.choice(("cut short", "bit flipped"))
        with path.open("r+b") as file:
            if how == "cut short":
                file.truncate(at)
            else:
                file.seek(at)
                (byte,) = file.read(1)
                file.seek(at)
                file.write(bytes([byte ^ 1 << self._random.randrange(8)]))
        self.counts[f"{path.suffix[1:]} file {how}"] += 1

    def _count_failpoints(self) -> None:
        """Count those that acted, and let what stopped there go on."""
        for name in list(self._asked):
            if not self._scene.cluster.token(name).exists():
                self._asked.remove(name)
                kind = self._actions[name].replace(":", " ")
                self.counts[f"failpoint: {kind}"] += 1
                if kind == "stop":
                    self._over.wait(self._random.uniform(0.1, _LONGEST_STOP_S))
                    for part in self._scene.cluster.parts:
                        part.send(signal.SIGCONT)


def _kind(part: Part | Child) -> str:
    return {"capture": "capture process", "up": "supervisor"}.get(
        name := part.name.split("-")[0], name)
