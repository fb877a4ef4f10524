"""Make the face that the kiosk's first screen turns: `python -m tests.simulator.sample_face`.

A burst of frames of a made-up person (MakeHuman, CC0), reconstructed as any other. Nobody's face,
and nobody need be credited.
"""

from pathlib import Path

from denseface.capture.burst import fuse
from denseface.recon.face import Face
from denseface.recon.pipeline import reconstruct
from denseface.service.export.face_grid import encode_face_grid
from tests.simulator.kinect import KINECT_CALIBRATED
from tests.simulator.scene import Light, Person, Scene
from tests.simulator.sensor import simulate

__all__ = ["SAMPLE"]

SAMPLE = (Path(__file__).resolve().parents[2]
          / "service" / "kiosk" / "frontend" / "public" / "sample.face")
_SCENE = Scene((Person("mh_asian_f", 640, yaw=4, pitch=3),),
               light=Light((0.3, -0.5, -1.0), 0.66, 0.40), holes=0.1, decor=3)
_FRAMES, _SEED = 12, 14


def sample_face() -> Face:
    """Reconstruct the sample; needs the head scans."""
    shots = simulate(_SCENE, KINECT_CALIBRATED, _SEED, _FRAMES)
    return reconstruct(fuse([shot.frame for shot in shots]))


def main() -> None:
    """Write the file."""
    SAMPLE.parent.mkdir(exist_ok=True)
    SAMPLE.write_bytes(encode_face_grid(sample_face()))


if __name__ == "__main__":
    main()
