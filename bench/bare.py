"""The bare function in a loop: reads a number of frames from stdin, says when they are done."""

import sys
from itertools import cycle

import cv2

from denseface.capture import open_source
from denseface.recon import reconstruct, warm


def main() -> int:
    """Serve until stdin ends."""
    cv2.setNumThreads(1)
    with open_source(sys.argv[1]) as source:
        frames = list(source)
    warm()
    for frame in frames:
        reconstruct(frame)
    print("warm", flush=True)
    order = cycle(frames)
    for line in sys.stdin:
        for _ in range(int(line)):
            reconstruct(next(order))
        print("done", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
