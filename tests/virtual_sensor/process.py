"""Processes that see the virtual sensor.

OpenNI2 is used in processes of their own: it is steered by the environment, can be loaded once
only, and a crash in it would end the tests. Environment variables, all read by the driver:

=================================== =============================================================
VIRTUAL_SENSOR_FRAMES               the frame file; without it no device is there
VIRTUAL_SENSOR_END                  ``loop`` (default) or ``stop``: silent after the last frame
VIRTUAL_SENSOR_SKEW_US              added to the colour stamps
VIRTUAL_SENSOR_DISCONNECT_AFTER     unplugged after that many frames
VIRTUAL_SENSOR_STREAMS              ``both`` (default), ``depth`` or ``color``
VIRTUAL_SENSOR_DEPTH_UNIT           ``100um``: depth in tenths of a millimetre
VIRTUAL_SENSOR_CONTROL              the files of control channels, separated by colons: one device
                                    for each, which they steer instead of all of the above
=================================== =============================================================
"""

import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from denseface.capture.frame import RgbdFrame
from denseface.capture.npz import load_frame
from tests import nursery
from tests.virtual_sensor.build import build
from tests.virtual_sensor.control import Control
from tests.waiting import LIMIT_S

__all__ = ["RECORD", "environment", "play", "record_clip", "run_python"]

_ROOT = Path(__file__).resolve().parents[2]
_PLAY = """
import sys
from itertools import islice
from denseface.capture import open_source
from denseface.capture.npz import save_frame
with open_source(sys.argv[1]) as source:
    for number, frame in enumerate(islice(source, int(sys.argv[3]))):
        save_frame(frame, f"{sys.argv[2]}/{number}.npz")
        print(frame.calibration_origin)
"""
RECORD = """
import sys
from pathlib import Path
from tests.virtual_sensor.recorder import record
record(Path(sys.argv[1]), int(sys.argv[2]))
"""


def environment(
    clip: Path | None = None, *, controls: Sequence[Control] = (), **options: Any
) -> dict[str, str]:
    """Give the environment in which a process sees the virtual sensor and no other driver.

    Parameters
    ----------
    clip : what `write_clip` wrote; without it no device is there, but recordings can be played
    controls : the devices that are there, each steered while it runs; `clip` and `options` do not
        matter then
    options : `end`, `skew_us`, `disconnect_after`, `streams`, `depth_unit` as in the table above
    """
    kept = {name: value for name, value in os.environ.items()
            if not name.startswith(("VIRTUAL_SENSOR_", "OPENNI2_REDIST"))}
    if clip is not None:
        options["frames"] = clip
    if controls:
        options["control"] = ":".join(str(control.path) for control in controls)
    return kept | {"OPENNI2_REDIST": str(build())} | {
        f"VIRTUAL_SENSOR_{name.upper()}": str(value) for name, value in options.items()}


def run_python(
    code: str,
    *arguments: object,
    env: dict[str, str],
    cwd: Path | None = None,
    timeout_s: float = LIMIT_S,
) -> subprocess.CompletedProcess[str]:
    """Run Python code in a process of its own and give what it said."""
    return nursery.run(["-c", code, *arguments], cwd=cwd, env=env | {"PYTHONPATH": str(_ROOT)},
                       timeout=timeout_s)


def record_clip(
    clip: Path, out: Path, frames: int, *, code: str = RECORD, attempts: int = 8
) -> None:
    """Record the virtual sensor with OpenNI2's own recorder: exactly the clip's frames.

    On a busy machine the recorder's thread misses a wake-up and writes a frame only when the next
    one comes; after the last none comes, so it is tried again.
    """
    env = environment(clip, end="stop")
    for _ in range(attempts):
        done = run_python(code, out, frames, env=env)
        if "the sensor fell silent" not in done.stderr:
            break
    if done.returncode:
        raise RuntimeError(f"recording {out.name} failed ({done.returncode}): {done.stderr}")


def play(
    uri: str | Path, env: dict[str, str] | None = None, max_frames: int = 1000
) -> tuple[list[RgbdFrame], str]:
    """Read frames in a process of its own; give also the calibration's origin."""
    with tempfile.TemporaryDirectory() as folder:
        done = run_python(_PLAY, uri, folder, max_frames, env=env or environment())
        if done.returncode or done.stderr:
            raise RuntimeError(f"playing {uri} failed ({done.returncode}): {done.stderr}")
        lines = done.stdout.splitlines()
        return [load_frame(f"{folder}/{i}.npz") for i in range(len(lines))], "".join(lines[:1])
