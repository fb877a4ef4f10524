"""Every file operation of a hub fails in turn, and power cuts lose what was not synced.

SQLite's own operations are among them. A library in C (`disk_faults.c`) stands between the process
and the system.
"""

import errno
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.chaos.power_cut import VARIANTS, Disk, read_log

__all__ = ["FOREVER", "Finding", "Sweep", "compile_faults", "sweep_all"]

FOREVER = 10**9
"""Number of operations that fail: from one on, all."""
_RUNS = (1, 2, 3, 4, 6, FOREVER)
"""Numbers of operations that fail one after another: a write, then what is to mend it."""
_ERRORS = {"EIO": errno.EIO, "ENOSPC": errno.ENOSPC}


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

    def operations(self) -> int:
        """Give the number of file operations where none fails."""
        result = self._play(log=str(self._log))
        if result["violations"]:
            raise RuntimeError(f"on a sound disk: {result['violations']}")
        return int(result["operations"])

    def syncs(self) -> list[int]:
        """Give the positions of those that sync a file or folder."""
        self._play(log=str(self._log))
        return [one.position for one in read_log(self._log, self._data) if one.kind == "sync"]

    def failing(self, error: str, count: int, positions: Iterable[int]) -> list[Finding]:
        """Let `count` operations fail, from each of the positions on."""
        found = []
        for position in positions:
            result = self._play(first=position, count=count, error=_ERRORS[error])
            often = "from then on" if count == FOREVER else f"{count} times"
            found += [Finding(f"{error} at operation {position}, {often}", one)
                      for one in result["violations"]]
        return found

    def power_cuts(self, every: int = 1, failing: int = -1) -> list[Finding]:
        """Cut the power after each or each `every`-th operation; `failing` fails before, by EIO."""
        self._play(log=str(self._log), first=failing, count=int(failing >= 0), error=errno.EIO)
        disk, told, found = Disk(), [], []
        for record in read_log(self._log, self._data):
            if record.kind == "mark":
                told.append(record.path)
                continue
            disk.do(record)
            if record.position % every or record.position < failing:
                continue
            for variant in VARIANTS:
                shutil.rmtree(self._data, ignore_errors=True)
                disk.write_to(self._data, variant)
                result = self._play(told=list(told))
                when = f"{record.position} ({record})"
                when += f", {failing} failed" if failing >= 0 else ""
                found += [Finding(f"power cut after operation {when}, {variant}", one)
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
    operations = sweep.operations()
    say(f"{operations} file operations")
    found = []
    for error in _ERRORS:
        for count in _RUNS:
            found += sweep.failing(error, count, range(operations))
            often = "from then on" if count == FOREVER else f"{count} times"
            say(f"{error} {often}: {sweep.cases} cases, {len(found)} promises broken")
    found += sweep.power_cuts()
    say(f"power cuts: {sweep.cases} cases, {len(found)} promises broken")
    for position in sweep.syncs():
        found += sweep.power_cuts(every=23, failing=position)
    say(f"power cuts after a sync that failed: {sweep.cases} cases, {len(found)} promises broken")
    sweep.close()
    return found
