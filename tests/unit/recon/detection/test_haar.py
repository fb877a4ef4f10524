"""The cascades' own loop finds what OpenCV's finds, and searches only where it is asked to."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from denseface.recon.detection._haar import load_cascade, passing_boxes

ALT2, DEFAULT = "haarcascade_frontalface_alt2", "haarcascade_frontalface_default"
PROFILE = "haarcascade_profileface"
EVERYWHERE = np.ones((1, 1), np.bool_)


@pytest.fixture(scope="module")
def gray(shot):
    return cv2.cvtColor(shot.frame.rgb, cv2.COLOR_RGB2GRAY)


def whole(image):
    """One cell, the whole image."""
    height, width = image.shape
    return np.array([[1 / width, 0, 0.5 / width], [0, 1 / height, 0.5 / height]])


def ours(image, name, smallest, largest, step, allowed=EVERYWHERE, to_cells=None):
    return set(passing_boxes(image, load_cascade(name), (smallest, largest), step, allowed,
                             whole(image) if to_cells is None else to_cells))


def theirs(image, name, smallest, largest, step):
    path = Path(cv2.__file__).parent / "data" / f"{name}.xml"
    found = cv2.CascadeClassifier(str(path)).detectMultiScale(
        image, scaleFactor=step, minNeighbors=0, minSize=(smallest,) * 2, maxSize=(largest,) * 2)
    return {tuple(int(side) for side in box) for box in found}


@pytest.mark.parametrize("name", [ALT2, DEFAULT, PROFILE])
@pytest.mark.parametrize(("shrink", "smallest", "largest", "step"), [
    (1.0, 80, 160, 1.05), (0.5, 20, 90, 1.1), (0.3, 24, 60, 1.2)])
def test_the_same_windows_pass_as_in_opencv(gray, name, shrink, smallest, largest, step):
    image = cv2.resize(gray, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    if name == PROFILE:  # of which a frontal face has few
        image = np.ascontiguousarray(np.hstack([image, image[:, ::-1]]))
    expected = theirs(image, name, smallest, largest, step)
    found = ours(image, name, smallest, largest, step)
    # A sum that rounding puts on the other side of its threshold is rare.
    assert len(found ^ expected) <= 0.02 * len(expected)
    assert expected or name == PROFILE


def test_only_boxes_whose_center_is_allowed_are_given(gray):
    side = 8
    everywhere = ours(gray, ALT2, 80, 160, 1.05)
    allowed = np.zeros((60, 80), np.bool_)
    x, y, w, h = sorted(everywhere)[len(everywhere) // 2]
    row, column = int((y + h / 2) / side), int((x + w / 2) / side)
    allowed[row, column] = True
    to_cells = np.array([[1 / side, 0, 0.5 / side], [0, 1 / side, 0.5 / side]])
    found = ours(gray, ALT2, 80, 160, 1.05, allowed, to_cells)
    assert (x, y, w, h) in found
    for left, top, wide, high in found:
        assert column * side - 4 <= left + wide / 2 <= (column + 1) * side + 4
        assert row * side - 4 <= top + high / 2 <= (row + 1) * side + 4
    # Where OpenCV leaves a window out beside one that the first stage refused, ours may not.
    assert len(found) < len(everywhere)
    assert ours(gray, ALT2, 80, 160, 1.05, np.zeros_like(allowed), to_cells) == set()


def test_boxes_keep_to_their_bounds(gray):
    for smallest, largest in ((90, 140), (20, 400)):
        boxes = ours(gray, ALT2, smallest, largest, 1.1)
        assert boxes
        assert all(smallest <= w <= largest and w == h for _, _, w, h in boxes)
    assert ours(gray, ALT2, 200, 300, 1.1) == set()


@pytest.mark.parametrize("shape", [(1, 1), (5, 60), (19, 19), (20, 20)])
def test_an_image_smaller_than_the_window_or_without_contrast_holds_nothing(shape):
    assert ours(np.full(shape, 90, np.uint8), ALT2, 20, 40, 1.1) == set()


def test_a_cascade_that_is_not_shipped_is_named():
    with pytest.raises(RuntimeError, match="nothing_at_all"):
        load_cascade("nothing_at_all")
