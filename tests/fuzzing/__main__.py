"""Fuzz the decoders with libFuzzer: what reaches new code is kept and broken further."""

import argparse
import contextlib
import hashlib
import os
import resource
import sys
import tempfile
import time
from pathlib import Path
from random import Random

import atheris

with atheris.instrument_imports(include=["denseface"]):
    from tests.fuzzing.corpus import encoded, pack, unpack
    from tests.fuzzing.mutate import mutate
    from tests.fuzzing.targets import Cost

_MOST_MB = 1024
_MOST_S = 10
_LONGEST = 600_000
_OLD = 0.4
"""Share of inputs that are made of one that reached something new."""


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="script/fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=1_000_000, metavar="N",
                        help="given to each of both decoders (1,000,000)")
    parser.add_argument("--seed", type=int, default=1, help="of the fuzzer's choices (1)")
    parser.add_argument("--found", type=Path, default=Path("fuzz-found"), metavar="DIR",
                        help="gets the input that failed (fuzz-found)")
    found = parser.parse_args()
    if found.inputs < 1 or found.seed < 1:
        parser.error("--inputs and --seed must be at least 1")
    return found


def main() -> None:
    """Run, print a row for docs/reliability.md, and exit; with another status where one failed."""
    options = _options()
    options.found.mkdir(parents=True, exist_ok=True)
    corpus = encoded()
    cost = Cost()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    start = time.monotonic()

    def one_input(data: bytes) -> None:
        cost.run(unpack(data))
        if cost.inputs == options.inputs:
            _report(cost, time.monotonic() - start, before)
            (options.found / "slowest").write_bytes(cost.slowest)
            os._exit(0)  # libFuzzer has no other way out

    def broken(data: bytes, longest: int, seed: int) -> bytes:
        # What was broken a hundred times is no message any more: often begin with one again.
        rng = Random(seed)
        parts = unpack(data) if rng.random() < _OLD else rng.choice(corpus)
        return pack(mutate(rng, parts, corpus))[:longest]

    with tempfile.TemporaryDirectory() as folder:
        for parts in corpus:
            data = pack(parts)
            (Path(folder) / hashlib.sha256(data).hexdigest()).write_bytes(data)
        atheris.Setup(
            [sys.argv[0], folder, f"-seed={options.seed}", f"-artifact_prefix={options.found}/",
             f"-max_len={_LONGEST}", "-len_control=0", f"-timeout={_MOST_S}",
             f"-rss_limit_mb={_MOST_MB}", "-print_final_stats=0", "-verbosity=0"],
            one_input, custom_mutator=broken)
        with contextlib.suppress(KeyboardInterrupt):
            atheris.Fuzz()


def _report(cost: Cost, took_s: float, before: int) -> None:
    print("| inputs to each decoder | messages among them | other exceptions | slowest input "
          "| most memory for one input | memory, start to peak | inputs / s |")
    print("|" + " --- |" * 7)
    print(f"| {cost.inputs:,} | {cost.messages:,} | 0 | {cost.slowest_s * 1e3:.0f} ms "
          f"({len(cost.slowest):,} bytes) | {cost.grown_bytes / 1e6:.1f} MB "
          f"| {before / 1e6:.0f} to {cost.peak_bytes / 1e6:.0f} MB "
          f"| {cost.inputs / took_s:,.0f} |", flush=True)


if __name__ == "__main__":
    main()
