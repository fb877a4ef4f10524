"""A pass of a cascade over a part of an image, rotated and mirrored."""

import cv2
import numpy as np
import pytest

from denseface.recon.detection._cascades import CascadePass, CenterMask, run_pass

ALT2 = "haarcascade_frontalface_alt2"
EVERYWHERE = CenterMask(np.ones((1, 1), np.bool_), 640.0)


@pytest.fixture(scope="module")
def gray(shot):
    return cv2.cvtColor(shot.frame.rgb, cv2.COLOR_RGB2GRAY)


@pytest.fixture(scope="module")
def straight(gray):
    seen, = run_pass(gray, (0, 0, 640, 480), CascadePass(ALT2, np.inf), 110, (90, 140), EVERYWHERE)
    assert seen.windows >= 5
    return seen.box


def center(box):
    x, y, w, h = box
    return np.array([x + (w - 1) / 2, y + (h - 1) / 2])


@pytest.mark.parametrize("face_px", [28.0, 42.0, 1000.0])
def test_a_part_gives_boxes_in_pixels_of_the_image(gray, straight, face_px):
    x, y, w, h = straight
    part = (x - 31, y - 17, w + 60, h + 50)
    (box, _), = run_pass(gray, part, CascadePass(ALT2, face_px, 1.1, 3), w, (0.7 * w, 1.4 * w),
                         EVERYWHERE)
    assert np.abs(center(box) - center(straight)).max() < 0.08 * w
    assert box[2] == pytest.approx(w, rel=0.15)


@pytest.mark.parametrize("degrees", [-30.0, 15.0, 30.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_rolled_or_mirrored_pass_gives_an_upright_box_about_the_same_center(
    gray, straight, degrees, mirrored
):
    """The image is rotated about a place off its centre; the pass rotates it back."""
    w = straight[2]
    image = gray[:, ::-1] if mirrored else gray
    place = center(straight)
    if mirrored:
        place[0] = gray.shape[1] - 1 - place[0]
    about = (place[0] + 20, place[1] - 10)
    # OpenCV rotates counterclockwise, a pass finds faces that are tipped clockwise.
    turn = cv2.getRotationMatrix2D(about, degrees if mirrored else -degrees, 1)
    tipped = cv2.warpAffine(image, turn, gray.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
    there = turn @ (*place, 1)
    left, top = np.rint(there - (0.8 * w, 0.9 * w)).astype(int)
    rolled = CascadePass(ALT2, 60, 1.1, 3, -degrees if mirrored else degrees, mirrored)
    (box, _), = run_pass(tipped, (left, top, round(1.7 * w), round(1.9 * w)), rolled, w,
                         (0.7 * w, 1.4 * w), EVERYWHERE)
    assert np.abs(center(box) - there).max() < 0.08 * w
    assert box[2] == pytest.approx(w, rel=0.15)
    # Centres are masked in the upright image, however the pass rotates it.
    near = CenterMask(np.ones((1, 1), np.bool_), 0.4 * w, *(there - 0.2 * w))
    aside = near._replace(left=near.left - 0.4 * w)
    part = (left, top, round(1.7 * w), round(1.9 * w))
    assert run_pass(tipped, part, rolled, w, (0.7 * w, 1.4 * w), near)
    assert run_pass(tipped, part, rolled, w, (0.7 * w, 1.4 * w), aside) == []
