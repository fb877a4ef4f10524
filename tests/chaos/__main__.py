"""`script/chaos`: thousands of presses under random faults, and a table of what came of them."""

import argparse
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.chaos.cluster import PACE, Nursery
from tests.chaos.disk import compile_faults, memory_folder, sweep_all
from tests.chaos.rounds import Outcome, is_supervised, play
from tests.chaos.source import write_small_frame

_ROUND = 500
"""Presses of one data folder; a round that breaks a promise can be played again by its seed."""
_SUPERVISED_ROUND = 300
"""The same under `denseface up`, whose processes take seconds to start."""


def main() -> int:
    """Play rounds and print the table; 1 where a promise was broken."""
    parser = argparse.ArgumentParser(prog="script/chaos", description=__doc__)
    parser.add_argument("--presses", type=int, default=10_000, help="in all (default: 10000)")
    parser.add_argument("--seed", type=int, default=1, help="of the first round (default: 1)")
    parser.add_argument("--minutes", type=float, help="begin no round after this time")
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()),
                        help="where a round that broke a promise is kept (default: %(default)s)")
    parser.add_argument("--disk", action="store_true", help="let every file operation of a hub "
                        "fail in turn, and cut the power after each, instead of presses")
    args = parser.parse_args()
    if args.disk:
        return _sweep_disk()
    os.environ |= PACE  # of our own clients
    began = time.monotonic()
    total, rounds, left = Outcome(), 0, args.presses
    with tempfile.TemporaryDirectory(prefix="chaos-") as temporary, Nursery(
            compile_faults(Path(temporary))) as nursery:
        frame = Path(temporary) / "frame.npz"
        write_small_frame(frame)
        while left > 0:
            minutes = (time.monotonic() - began) / 60
            if args.minutes is not None and minutes >= args.minutes:
                break
            seed = args.seed + rounds
            presses = min(left, _SUPERVISED_ROUND if is_supervised(seed) else _ROUND)
            folder = Path(temporary) / f"seed-{seed}"
            outcome = play(nursery, folder, frame, presses, seed)
            total.add(outcome)
            rounds, left = rounds + 1, left - presses
            _say(f"seed {seed}: {presses} presses, {outcome.restarts} restarts, "
                 f"{outcome.ends['dead']} dead letters, {len(outcome.violations)} violations, "
                 f"{(time.monotonic() - began) / 60:.1f} min")
            for line in outcome.violations[:20]:
                _say(f"  {line}")
            if outcome.violations:
                kept = args.keep / f"chaos-seed-{seed}"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.move(folder, kept)
                _say(f"  kept in {kept}; again: script/chaos --seed {seed} --presses {presses}")
            else:
                shutil.rmtree(folder)
    _say(f"{rounds} rounds, seeds {args.seed} to {args.seed + rounds - 1}, "
         f"{(time.monotonic() - began) / 60:.1f} min")
    print(_table(total))
    return 1 if total.violations else 0


def _sweep_disk() -> int:
    with memory_folder() as temporary:
        folder = Path(temporary)
        found = sweep_all(compile_faults(folder), folder, _say)
    for one in found:
        print(one)
    return 1 if found else 0


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _table(total: Outcome) -> str:
    rows = [(f"fault: {kind}", count) for kind, count in sorted(total.faults.items())]
    rows += [("processes started again", total.restarts),
             ("presses accepted", total.answers["accepted"]),
             ("presses refused", total.answers["refused"]),
             ("presses never answered", total.answers["unknown"]),
             ("faces", total.ends["done"]),
             ("dead letters", total.ends["dead"]),
             ("jobs given out again", total.redelivered)]
    lines = [f"| {name} | {count:,} |" for name, count in rows]
    if total.latencies_s:
        p50, p99 = np.percentile(total.latencies_s, (50, 99))
        lines.append(f"| press to published outcome, p50 / p99 | {p50:.2f} s / {p99:.2f} s |")
    lines.append(f"| **promises broken** | **{len(total.violations)}** |")
    return "\n".join(["| | |", "| --- | ---: |", *lines])


if __name__ == "__main__":
    sys.exit(main())
