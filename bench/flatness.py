"""Whether a worker's memory stays flat: thousands of frames in one process."""

import argparse
import sys
import time
from contextlib import suppress
from itertools import cycle, islice

from bench.accuracy import RECORDINGS
from bench.machine import describe
from bench.memory import resident_mb
from denseface.capture import RgbdFrame, open_source
from denseface.recon import ReconstructionError, reconstruct, warm

__all__: list[str] = []

_EVERY = 1000


def main() -> int:
    """Print the resident set as the frames go by."""
    parser = argparse.ArgumentParser(prog="script/bench flatness", description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000, help="how many (20,000)")
    args = parser.parse_args()
    if args.frames < 1:
        parser.error(f"--frames must be at least 1, got {args.frames}")
    frames: list[RgbdFrame] = []
    for path in sorted(RECORDINGS.glob("*.oni")):
        with open_source(str(path)) as source:
            frames.extend(islice(source, 1))
    warm()
    print(describe("script/bench flatness " + " ".join(sys.argv[1:])))
    print(f"\nThe first frame of each of {len(frames)} recordings by turns, in one process, as a "
          "worker has them; a frame without a face counts like any other.\n")
    print("| frames | resident set, MiB | ms a frame since the line above |\n| --- | --- | --- |")
    print(f"| 0 | {resident_mb():.1f} | - |", flush=True)
    start, before = time.perf_counter(), 0
    for done, frame in enumerate(islice(cycle(frames), args.frames), 1):
        with suppress(ReconstructionError):
            reconstruct(frame)
        if done in (len(frames), 100) or done % _EVERY == 0 or done == args.frames:
            now = time.perf_counter()
            each = (now - start) / (done - before) * 1e3
            print(f"| {done:,} | {resident_mb():.1f} | {each:.1f} |", flush=True)
            start, before = time.perf_counter(), done
    return 0


if __name__ == "__main__":
    sys.exit(main())
