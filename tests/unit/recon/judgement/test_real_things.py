"""What a real sensor saw: objects that detection takes for faces, and a person in profile."""

import cv2
import pytest

from denseface.capture.calibration import Calibration, CameraModel
from denseface.capture.frame import RgbdFrame
from denseface.capture.npz import load_frame
from denseface.recon import NoFaceError, reconstruct
from tests.simulator import shared_folder

SHARED = shared_folder()

pytestmark = pytest.mark.skipif(
    SHARED is None or not (SHARED / "reports" / "tin.npz").exists(),
    reason="the frames of real tables are not at hand: ../shared/reports")


@pytest.mark.parametrize("thing", ["tin", "cereal_or_tin"])
def test_a_real_thing_is_no_face(thing):
    """Colour alone takes each for one; depth, before or after the shape is known, does not."""
    with pytest.raises(NoFaceError, match="no face found"):
        reconstruct(load_frame(SHARED / "reports" / f"{thing}.npz"))


def test_a_real_face_in_profile_is_one():
    path = SHARED / "recordings" / "kinect_v1_person_profile_depth_mm.png"
    camera = CameraModel(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
    frame = RgbdFrame(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), None, 0, 0,
                      Calibration(depth=camera, color=camera))
    assert reconstruct(frame).report.face_score > 0.5
