"""The cascades, over parts of an image, turned and mirrored."""

import cv2
import numpy as np
import pytest

from recon._cascades import Look, find_boxes, look_for_faces

ALT2 = "haarcascade_frontalface_alt2"


@pytest.fixture(scope="module")
def gray(shot):
    return cv2.cvtColor(shot.frame.color, cv2.COLOR_RGB2GRAY)


@pytest.fixture(scope="module")
def straight(gray):
    box, = find_boxes(gray, ALT2, 90, 140)
    return box


def middle(box):
    x, y, w, h = box
    return np.array([x + (w - 1) / 2, y + (h - 1) / 2])


def test_boxes_keep_to_their_bounds(gray):
    for smallest, largest in ((90, 140), (20, 400)):
        boxes = find_boxes(gray, ALT2, smallest, largest)
        assert boxes
        assert all(smallest <= w <= largest and w == h for _, _, w, h in boxes)
    assert find_boxes(gray, ALT2, 200, 300) == []


def test_a_cascade_that_is_not_shipped_is_named(gray):
    with pytest.raises(RuntimeError, match="nothing_at_all"):
        find_boxes(gray, "nothing_at_all", 40, 80)


@pytest.mark.parametrize("face_px", [28.0, 42.0, 1000.0])
def test_a_part_gives_boxes_in_pixels_of_the_image(gray, straight, face_px):
    x, y, w, h = straight
    part = (x - 31, y - 17, w + 60, h + 50)
    box, = look_for_faces(gray, part, Look(ALT2, face_px, 1.1, 3), w, (0.7 * w, 1.4 * w))
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
                          (0.7 * w, 1.4 * w))
    assert np.abs(middle(box) - there).max() < 0.08 * w
    assert box[2] == pytest.approx(w, rel=0.15)
