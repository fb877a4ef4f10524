"""The cascades, over parts of an image, turned and mirrored."""

import cv2
import numpy as np
import pytest

from denseface.recon.detection._cascades import Look, Middles, look_for_faces

ALT2 = "haarcascade_frontalface_alt2"
ANYWHERE = Middles(np.ones((1, 1), np.bool_), 640.0)


@pytest.fixture(scope="module")
def gray(shot):
    return cv2.cvtColor(shot.frame.color, cv2.COLOR_RGB2GRAY)


@pytest.fixture(scope="module")
def straight(gray):
    box, = look_for_faces(gray, (0, 0, 640, 480), Look(ALT2, np.inf), 110, (90, 140), ANYWHERE)
    return box


def middle(box):
    x, y, w, h = box
    return np.array([x + (w - 1) / 2, y + (h - 1) / 2])


@pytest.mark.parametrize("face_px", [28.0, 42.0, 1000.0])
def test_a_part_gives_boxes_in_pixels_of_the_image(gray, straight, face_px):
    x, y, w, h = straight
    part = (x - 31, y - 17, w + 60, h + 50)
    box, = look_for_faces(gray, part, Look(ALT2, face_px, 1.1, 3), w, (0.7 * w, 1.4 * w),
                          ANYWHERE)
    assert np.abs(middle(box) - middle(straight)).max() < 0.08 * w
    assert box[2] == pytest.approx(w, rel=0.15)


@pytest.mark.parametrize("degrees", [-30.0, 15.0, 30.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_turned_or_mirrored_look_gives_an_upright_box_about_the_same_middle(
    gray, straight, degrees, mirrored
):
    """The image is turned about a place off its middle; the look turns it back."""
    w = straight[2]
    image = gray[:, ::-1] if mirrored else gray
    place = middle(straight)
    if mirrored:
        place[0] = gray.shape[1] - 1 - place[0]
    about = (place[0] + 20, place[1] - 10)
    # OpenCV turns against the clock, a look is for faces that are tipped with it.
    turn = cv2.getRotationMatrix2D(about, degrees if mirrored else -degrees, 1)
    tipped = cv2.warpAffine(image, turn, gray.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
    there = turn @ (*place, 1)
    left, top = np.rint(there - (0.8 * w, 0.9 * w)).astype(int)
    look = Look(ALT2, 60, 1.1, 3, roll=-degrees if mirrored else degrees, mirrored=mirrored)
    box, = look_for_faces(tipped, (left, top, round(1.7 * w), round(1.9 * w)), look, w,
                          (0.7 * w, 1.4 * w), ANYWHERE)
    assert np.abs(middle(box) - there).max() < 0.08 * w
    assert box[2] == pytest.approx(w, rel=0.15)
    # Only where the middle of the upright image's box is wanted, whatever the look does to it.
    near = Middles(np.ones((1, 1), np.bool_), 0.4 * w, *(there - 0.2 * w))
    aside = near._replace(left=near.left - 0.4 * w)
    part = (left, top, round(1.7 * w), round(1.9 * w))
    assert look_for_faces(tipped, part, look, w, (0.7 * w, 1.4 * w), near)
    assert look_for_faces(tipped, part, look, w, (0.7 * w, 1.4 * w), aside) == []
