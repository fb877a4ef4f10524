"""Make the recordings in fixtures/recorded_oni (`script/fixtures`).

Each scene is rendered by `tests.simulator`, shown by the virtual sensor and recorded by OpenNI2's
own recorder. Beside it go the true surface and, where the sensor is not the default one, its
calibration. The same code gives the same depth, bit for bit.
"""

import argparse
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from denseface.capture.frame import RgbdFrame
from tests.simulator import (
    KINECT_CALIBRATED,
    KINECT_DEFAULT,
    KinectModel,
    Light,
    Person,
    Scene,
    head_names,
    simulate,
)
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.process import play, record_clip

__all__ = ["FIXTURES", "FOLDER", "Fixture", "make"]

FOLDER = Path(__file__).resolve().parents[2] / "fixtures" / "recorded_oni"
_MAX_TOTAL_BYTES = 12_000_000
"""Of the folder."""
_MAX_FILE_BYTES = 2_400_000
"""Of a recording."""
_JPEG_LOSS = 3.0
"""Mean difference of colours that is JPEG's, grey levels."""
_CODEC_TAIL = 32
"""Pixels at the end of a frame that OpenNI2's depth codec may get wrong."""


@dataclass(frozen=True)
class Fixture:
    """One recording to be made."""

    scene: Scene
    sensor: KinectModel = KINECT_DEFAULT
    frames: int = 3
    seed: int = 0


FIXTURES = {
    "frontal_700": Fixture(
        Scene((Person("lps", 700),)), seed=1),
    "turned_18": Fixture(
        Scene((Person("ict_neutral", 720, yaw=18),), decor=1), KINECT_CALIBRATED, seed=2),
    "far_1000": Fixture(
        Scene((Person("mh_afr_f", 1000, yaw=-5),), decor=2), seed=3),
    "dark_skin": Fixture(
        Scene((Person("mh_afr_f", 750, pitch=3, skin_gain=(0.7, 0.65, 0.62)),), decor=3), seed=4),
    "wall_close": Fixture(
        Scene((Person("ict_neutral", 750, yaw=-4),), wall_mm=1000, decor=4), seed=5),
    "face_fills_box": Fixture(
        Scene((Person("mh_cauc_m", 600, shoulders=False, scale=1.08),), wall_mm=15_000, decor=5),
        KINECT_CALIBRATED, seed=6),
    "many_holes": Fixture(
        Scene((Person("lps", 780, yaw=-8, offset_mm=(-40, 20)),), holes=1.0, decor=6),
        KINECT_CALIBRATED, seed=7),
    "side_light": Fixture(
        Scene((Person("mh_cauc_m", 700, yaw=6),),
              light=Light(toward=(1.0, -0.2, -0.25), intensity=1.0, ambient=0.12), decor=7),
        seed=8),
    "two_people": Fixture(
        Scene((Person("mh_cauc_m", 1150, offset_mm=(230, -30)),
               Person("lps", 750, yaw=-6, offset_mm=(-110, 10))), decor=8), seed=9),
    "empty_room": Fixture(Scene((), decor=9), seed=10),
}


def make(name: str, folder: Path) -> list[Path]:
    """Make one recording with its truth and calibration; give the files."""
    fixture = FIXTURES[name]
    shots = simulate(fixture.scene, fixture.sensor, fixture.seed, fixture.frames)
    frames = [shot.frame for shot in shots]
    with tempfile.TemporaryDirectory() as name_of_scratch:
        scratch = Path(name_of_scratch)
        write_clip(scratch / "clip", [(frame.depth, frame.rgb) for frame in frames])
        oni = scratch / f"{name}.oni"
        record_clip(scratch / "clip", oni, len(frames))
        _compare(name, frames, play(oni)[0])
        if fixture.scene.people:
            shots[0].truth.save(scratch / f"{name}.truth.npz")
        if fixture.sensor is not KINECT_DEFAULT:
            (scratch / f"{name}.calibration.json").write_text(
                fixture.sensor.calibration.model_dump_json(indent=1) + "\n")
        for old in folder.glob(f"{name}.*"):
            old.unlink()
        return [Path(shutil.copy(new, folder)) for new in sorted(scratch.glob(f"{name}.*"))]


def _compare(name: str, shown: list[RgbdFrame], played: list[RgbdFrame]) -> None:
    """What is played must be what was shown: depth to the bit, colour but for JPEG's loss.

    But for the end of the last row: OpenNI2's depth codec swaps the last pixel with a run of equal
    ones before it, when it has half a byte left at the end.
    """
    if len(shown) != len(played):
        raise RuntimeError(f"{name}: {len(shown)} frames were shown, {len(played)} are played")
    for number, (a, b) in enumerate(zip(shown, played, strict=True)):
        loss = float(np.abs(a.rgb.astype(np.int16) - b.rgb).mean())
        wrong = np.flatnonzero(a.depth != b.depth)
        if (wrong < a.depth.size - _CODEC_TAIL).any() or loss > _JPEG_LOSS:
            raise RuntimeError(f"{name}: frame {number} is not played as it was shown "
                               f"(mean color difference {loss:.2f})")


def main() -> int:
    """Make all recordings, or those named."""
    parser = argparse.ArgumentParser(
        prog="script/fixtures", description="Make the recordings in fixtures/recorded_oni.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(FIXTURES))
    names = parser.parse_args().names or list(FIXTURES)
    if unknown := set(names) - set(FIXTURES):
        parser.error(f"no such fixture: {', '.join(sorted(unknown))}")
    needed = {person.head for name in names for person in FIXTURES[name].scene.people}
    if missing := needed - set(head_names()):
        parser.error(f"the head scans {', '.join(sorted(missing))} are not at hand: they are read "
                     "from the folder `shared` beside the repository, or DENSEFACE_SHARED")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names:
        for path in make(name, FOLDER):
            size = path.stat().st_size
            print(f"{path.relative_to(FOLDER.parents[1])}: {size / 1000:,.0f} kB")
            if size > _MAX_FILE_BYTES:
                print(f"{path.name} is larger than {_MAX_FILE_BYTES} bytes", file=sys.stderr)
                return 1
    total = sum(path.stat().st_size for path in FOLDER.iterdir())
    print(f"{total / 1e6:.1f} MB in all")
    if total > _MAX_TOTAL_BYTES:
        print(f"fixtures take more than {_MAX_TOTAL_BYTES} bytes", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
