"""Every file operation of a hub fails in turn, and power cuts lose what was not synced.

SQLite's own operations are among them. A library in C (`disk_faults.c`) stands between the process
and the system.
"""

import errno
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.chaos.power_cut import VARIANTS, Disk, read_log

__all__ = ["FOREVER", "Finding", "Sweep", "compile_faults", "memory_folder",
           "sweep_all"]

FOREVER = 10**9
"""Number of operations that fail: from one on, all."""
_RUNS = (1, 2, 3, 4, 6, FOREVER)
"""Numbers of operations that fail one after another: a write, then what is to mend it."""
_SOON = 4
"""Operations after one that failed: by then it is said what became of it."""
_ERRORS = {"EIO": errno.EIO, "ENOSPC": errno.ENOSPC}


def memory_folder() -> tempfile.TemporaryDirectory[str]:
    """Make a folder whose disk is memory, where there is one: its syncs take no time."""
    memory = Path("/dev/shm")  # noqa: S108
    return tempfile.TemporaryDirectory(
        prefix="disk-faults-", dir=memory if os.access(memory, os.W_OK) else None)


def compile_faults(folder: Path) -> Path:
    """Build the library; CalledProcessError where it cannot be."""
    library = folder / "disk_faults.so"
    subprocess.run(["cc", "-O1", "-Wall", "-shared", "-fPIC", "-o", library,
                    Path(__file__).with_name("disk_faults.c"), "-ldl"], check=True)
    return library


@dataclass(frozen=True)
class Finding:
    """A promise that was broken, and how it is played again."""

    case: str
    violation: str

    def __str__(self) -> str:
        return f"{self.case}: {self.violation}"


class Sweep:
    """One process that plays cases; `close` ends it.

    Parameters
    ----------
    library : from `compile_faults`
    folder : for data folders, one at a time
    """

    def __init__(self, library: Path, folder: Path) -> None:
        self._data, self._log = folder / "data", folder / "operations"
        self.cases = 0
        self._child = subprocess.Popen(
            [sys.executable, "-m", "tests.chaos.disk_child"], text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env=os.environ | {"LD_PRELOAD": str(library)})

    def close(self) -> None:
        """End the process."""
        self._child.communicate()

    def operations(self, hub: int = 0) -> int:
        """Give the number of file operations of the first or second hub where none fails."""
        result = self._play(hubs=[{} for _ in range(hub + 1)])
        if result["violations"]:
            raise RuntimeError(f"on a sound disk: {result['violations']}")
        return int(result["operations"])

    def syncs(self) -> list[int]:
        """Give the positions of those of the first hub that sync a file or folder."""
        self._play(hubs=[{"log": str(self._log)}])
        return [one.position for one in read_log(self._log, self._data) if one.kind == "sync"]

    def failing(
        self, error: str, count: int, positions: Iterable[int], hub: int = 0
    ) -> list[Finding]:
        """Let `count` operations of the first or second hub fail, from each of the positions on.

        The first is killed before the second.
        """
        found = []
        for position in positions:
            faults = {"first": position, "count": count, "error": _ERRORS[error]}
            result = self._play(hubs=[{} for _ in range(hub)] + [faults])
            often = "from then on" if count == FOREVER else f"{count} times"
            found += [Finding(f"{error} at operation {position} of hub {hub}, {often}", one)
                      for one in result["violations"]]
        return found

    def failing_twice(self, seed: int, cases: int) -> list[Finding]:
        """Let operations of both hubs fail, drawn from a seed."""
        chance = random.Random(seed)
        operations, found = [self.operations(hub) for hub in range(2)], []
        for _ in range(cases):
            hubs = [{"first": chance.randrange(most), "count": chance.choice(_RUNS),
                     "error": chance.choice(list(_ERRORS.values()))} for most in operations]
            found += [Finding(f"{hubs}", one) for one in self._play(hubs=hubs)["violations"]]
        return found

    def power_cuts(self, every: int = 1, failing: int = -1) -> list[Finding]:
        """Cut the power after each or each `every`-th operation of both hubs.

        The operation `failing` of the first fails with EIO before, and the power is cut after each
        of the next few too. The first hub is killed.
        """
        logs = [self._log.with_suffix(f".{hub}") for hub in range(2)]
        faults = {"first": failing, "count": int(failing >= 0), "error": errno.EIO}
        self._play(hubs=[{"log": str(logs[0]), **faults}, {"log": str(logs[1])}])
        disk, told, found = Disk(), [], []
        records = [(hub, one) for hub, log in enumerate(logs) for one in read_log(log, self._data)]
        for hub, record in records:
            if record.kind == "mark":
                told.append(record.path)
                continue
            disk.do(record)
            after = record.position - failing if hub == 0 else every
            if after < 0 or (record.position % every and not (failing >= 0 and after <= _SOON)):
                continue
            for variant in VARIANTS:
                shutil.rmtree(self._data, ignore_errors=True)
                disk.write_to(self._data, variant)
                result = self._play(told=list(told))
                when = f"operation {record.position} of hub {hub} ({record})"
                when += f", {failing} failed" if failing >= 0 else ""
                found += [Finding(f"power cut after {when}, {variant}", one)
                          for one in result["violations"]]
        return found

    def _play(self, **case: Any) -> dict[str, Any]:
        if "told" not in case:
            shutil.rmtree(self._data, ignore_errors=True)
        self.cases += 1
        assert self._child.stdin
        assert self._child.stdout
        print(json.dumps({"folder": str(self._data), **case}), file=self._child.stdin, flush=True)
        result: dict[str, Any] = json.loads(self._child.stdout.readline())
        return result


def sweep_all(library: Path, folder: Path, say: Callable[[str], None]) -> list[Finding]:
    """Play all cases: each error at each operation, a power cut after each; minutes."""
    sweep = Sweep(library, folder)
    found = []
    for hub in range(2):
        for error in _ERRORS:
            for count in _RUNS:
                found += sweep.failing(error, count, range(sweep.operations(hub)), hub)
                often = "from then on" if count == FOREVER else f"{count} times"
                say(f"hub {hub}, {error} {often}: {sweep.cases} cases, "
                    f"{len(found)} promises broken")
    found += sweep.failing_twice(1, 1000)
    say(f"both hubs: {sweep.cases} cases, {len(found)} promises broken")
    found += sweep.power_cuts()
    say(f"power cuts: {sweep.cases} cases, {len(found)} promises broken")
    for position in sweep.syncs():
        found += sweep.power_cuts(every=23, failing=position)
    say(f"power cuts after a sync that failed: {sweep.cases} cases, {len(found)} promises broken")
    sweep.close()
    return found
