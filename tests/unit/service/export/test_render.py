"""The rendering of a face."""

import cv2
import numpy as np

from denseface.service.export._lighting import shade
from denseface.service.export.render import portrait, render
from tests.unit.service.faces import small_face


def test_the_picture_shows_the_surface_without_gaps_and_the_seeds_with_them():
    png = cv2.imdecode(np.frombuffer(render(small_face()), np.uint8), cv2.IMREAD_COLOR)
    assert png.shape == (1398, 1916, 3)
    rows, columns = slice(300, 460), slice(240, 400)
    seeds, dense = png[rows, columns], png[rows, 634 + 240:634 + 400]
    background = np.array([37, 34, 31])
    assert not (dense == background).all(axis=-1).any()
    assert 0.2 < (seeds == background).all(axis=-1).mean() < 0.95


def test_the_middle_of_the_picture_has_the_face_s_colours():
    face = small_face()
    png = cv2.imdecode(np.frombuffer(render(face), np.uint8), cv2.IMREAD_COLOR)
    blue, green, red = png[74 + 310, 14 + 634 + 310]
    middle = face.dense.colors[np.argmin(np.abs(face.dense.points[:, :2]).sum(axis=1))]
    np.testing.assert_allclose([red, green, blue], middle, atol=25)


def test_light_comes_from_the_upper_left():
    left, right, up, down = shade(np.array(
        [[-0.8, 0, -0.6], [0.8, 0, -0.6], [0, -0.8, -0.6], [0, 0.8, -0.6]]))[:, 0].astype(int)
    assert left > right
    assert up > down


def test_a_portrait_is_square_without_words_and_as_wide_as_asked():
    face = small_face()
    png = cv2.imdecode(np.frombuffer(portrait(face, 240), np.uint8), cv2.IMREAD_COLOR)
    assert png.shape == (240, 240, 3)
    middle = face.dense.colors[np.argmin(np.abs(face.dense.points[:, :2]).sum(axis=1))]
    np.testing.assert_allclose(png[120, 120, ::-1], middle, atol=25)
    assert (png[0, 0] == [37, 34, 31]).all()
