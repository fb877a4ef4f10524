"""What 1 stands for in a depth image."""

import numpy as np
import pytest

from denseface.capture.errors import FrameError
from denseface.capture.image_pair._units import counts_of, guess_unit, parse_unit
from tests.unit.capture.image_pair.files import DEPTH

METRES = DEPTH / 1000


@pytest.mark.parametrize(("text", "mm"), [
    ("mm", 1), ("m", 1000), ("100um", 0.1), ("0.2mm", 0.2), ("250 µm", 0.25), ("1MM", 1),
    (".5mm", 0.5), ("cm", 10)])
def test_units(text, mm):
    assert parse_unit(text) == pytest.approx(mm)


@pytest.mark.parametrize("text", ["", "5000", "inch", "-1mm", "0mm", "1e3mm", "2m", "mm2", "nan m"])
def test_what_is_no_unit(text):
    with pytest.raises(ValueError, match="expected a unit"):
        parse_unit(text)


@pytest.mark.parametrize(("values", "mm"), [
    (DEPTH, 1), (METRES, 1000), (METRES.astype(np.float32), 1000), (METRES * 1000.3, 1),
    (DEPTH.astype(np.float32), 1), (np.full((4, 4), 1.0, np.float32) * [1, 2, 3, 4], 1000)])
def test_a_unit_is_guessed_where_one_makes_sense(values, mm):
    assert guess_unit(values) == mm


@pytest.mark.parametrize("values", [
    DEPTH * 5, DEPTH * 10, DEPTH * np.uint16(3), METRES / METRES.max(), METRES * 40, DEPTH // 10])
def test_and_asked_for_where_several_do(values):
    with pytest.raises(FrameError, match="--unit"):
        guess_unit(values)


def test_a_depth_without_readings_has_no_unit():
    for nothing in (0, np.nan, -np.inf):
        with pytest.raises(FrameError, match="no pixel has a reading"):
            guess_unit(np.full((4, 4), nothing))


def test_whole_millimetres_stay():
    depth, unit_um = counts_of(DEPTH, 1.0)
    assert unit_um == 1000
    np.testing.assert_array_equal(depth, DEPTH)


def test_tenths_of_millimetres_keep_their_unit():
    fine = DEPTH * 10 + (DEPTH > 0)
    depth, unit_um = counts_of(fine.astype(np.uint16), 0.1)
    assert unit_um == 100
    np.testing.assert_array_equal(depth, fine)


def test_tum_depths_are_whole_millimetres_times_five():
    depth, unit_um = counts_of((DEPTH * 5).astype(np.uint16), 0.2)
    assert unit_um == 1000
    np.testing.assert_array_equal(depth, DEPTH)
    odd = (DEPTH * 5 + (DEPTH > 0)).astype(np.uint16)
    assert counts_of(odd, 0.2).unit_um == 200


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_metres_become_tenths_of_millimetres(kind):
    depth, unit_um = counts_of(METRES.astype(kind), 1000.0)
    assert unit_um == 100
    np.testing.assert_allclose(depth / 10, DEPTH, atol=0.6 if kind is np.float16 else 0.051)


def test_far_readings_take_a_coarser_unit_and_what_cannot_be_is_no_reading():
    values = np.array([[0.7, 12.0, 40.0, 64.0, 99.0, np.nan, np.inf, -1.0, 0.0]])
    depth, unit_um = counts_of(values, 1000.0)
    assert unit_um == 1000
    np.testing.assert_array_equal(depth, [[700, 12000, 40000, 64000, 0, 0, 0, 0, 0]])


def test_a_saturated_number_is_no_reading():
    depth, _ = counts_of(np.array([[700, 65535]], np.uint16), 1.0)
    np.testing.assert_array_equal(depth, [[700, 0]])


@pytest.mark.parametrize("dtype", [np.int16, np.int32, np.uint32, np.int64])
def test_other_whole_numbers(dtype):
    values = DEPTH.astype(dtype)
    values[0, 0] = -5 if np.iinfo(dtype).min else 0
    np.testing.assert_array_equal(counts_of(values, 1.0).depth, DEPTH)
    if dtype().itemsize > 2:
        micrometres = counts_of(values * 1000, 0.001)
        np.testing.assert_allclose(micrometres.depth * (micrometres.unit_um / 1000), DEPTH)
