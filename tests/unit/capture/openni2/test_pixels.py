"""Frames of a driver as arrays, from memory of our own."""

import numpy as np
import pytest

from denseface.capture.errors import WrongSizeError
from denseface.capture.openni2._pixels import (
    Layout,
    copy_raw,
    format_name,
    format_number,
    image_of,
    raw_bytes,
)

rng = np.random.default_rng(11)
DEPTH = rng.integers(0, 10_000, (48, 64), np.uint16)
RGB = rng.integers(0, 256, (48, 64, 3), np.uint8)


def copied(image, pixel_format, *, size=(64, 48), pad=0, mirrored=False, **changes):
    """Copy an image that lies in the driver's memory with `pad` bytes after each row."""
    rows = np.ascontiguousarray(image).view(np.uint8).reshape(image.shape[0], -1)
    driver = np.pad(rows, ((0, 0), (0, pad)), constant_values=7)
    layout = Layout(**{"width": image.shape[1], "height": image.shape[0],
                       "pixel_format": pixel_format, "stride": driver.shape[1],
                       "bytes": driver.size} | changes)
    own = np.full(raw_bytes(size, pixel_format), 99, np.uint8)
    copy_raw(driver.ctypes.data, layout, size, pixel_format, own)
    driver[:] = 0  # as the next frame's
    taken = image_of(own, pixel_format, size, mirrored=mirrored)
    own[:] = 0  # as a ring's
    return taken


@pytest.mark.parametrize("pad", [0, 16])
@pytest.mark.parametrize(("image", "pixel_format"), [
    (DEPTH, "DEPTH_1_MM"), (DEPTH, "DEPTH_100_UM"), (RGB, "RGB888")])
def test_bit_exact(image, pixel_format, pad):
    taken = copied(image, pixel_format, pad=pad)
    assert taken.dtype == image.dtype
    assert taken.flags.c_contiguous
    np.testing.assert_array_equal(taken, image)


def test_turned_back():
    np.testing.assert_array_equal(copied(DEPTH, "DEPTH_1_MM", mirrored=True), DEPTH[:, ::-1])
    np.testing.assert_array_equal(copied(RGB, "RGB888", mirrored=True), RGB[:, ::-1])


def yuv(rgb, order):
    """Pack an image in BT.601 as Y U Y V or U Y V Y, two pixels sharing U and V."""
    r, g, b = (rgb[..., c].astype(np.float64) for c in range(3))
    y = 16 + (65.738 * r + 129.057 * g + 25.064 * b) / 256
    u = 128 + (-37.945 * r - 74.494 * g + 112.439 * b) / 256
    v = 128 + (112.439 * r - 94.154 * g - 18.285 * b) / 256
    packed = np.empty((*rgb.shape[:2], 2))
    luma, chroma = (0, 1) if order == "YUYV" else (1, 0)
    packed[..., luma] = y
    packed[:, ::2, chroma], packed[:, 1::2, chroma] = u[:, ::2], v[:, ::2]
    return np.round(packed).astype(np.uint8)


@pytest.mark.parametrize("pad", [0, 16])
@pytest.mark.parametrize("pixel_format", ["YUV422", "YUYV"])
def test_yuv_becomes_rgb(pixel_format, pad):
    pairs = np.repeat(rng.integers(0, 256, (48, 32, 3), np.uint8), 2, axis=1)
    taken = copied(yuv(pairs, pixel_format), pixel_format, pad=pad)
    assert taken.shape == (48, 64, 3)
    assert np.abs(taken.astype(int) - pairs).max() <= 3
    turned = copied(yuv(pairs, pixel_format), pixel_format, mirrored=True)
    np.testing.assert_array_equal(turned, taken[:, ::-1])


def test_a_cropped_frame_is_put_where_it_belongs():
    part = copied(DEPTH[10:30, 20:60], "DEPTH_1_MM", crop=(20, 10))
    expected = np.zeros_like(DEPTH)
    expected[10:30, 20:60] = DEPTH[10:30, 20:60]
    np.testing.assert_array_equal(part, expected)


@pytest.mark.parametrize("pixel_format", ["RGB888", "YUV422", "YUYV"])
def test_what_was_cropped_away_is_black(pixel_format):
    image = RGB if pixel_format == "RGB888" else yuv(RGB, pixel_format)
    part = copied(image[10:30, 20:60], pixel_format, crop=(20, 10), pad=8)
    np.testing.assert_array_equal(part[10:30, 20:60], copied(image, pixel_format)[10:30, 20:60])
    assert part.sum() == part[10:30, 20:60].sum()


@pytest.mark.parametrize("changes", [
    {"size": (32, 24)}, {"size": (64, 47)}, {"stride": 126}, {"bytes": 128 * 48 - 1},
    {"width": 65}, {"height": 0, "crop": (0, 0)}, {"crop": (1, 0)}, {"crop": (0, -1)},
    {"width": -1}])
def test_a_frame_that_is_not_as_it_says(changes):
    with pytest.raises(WrongSizeError, match=r"a frame of -?\d+x\d+ \w+ in \d+ bytes.*, expected"):
        copied(DEPTH, "DEPTH_1_MM", **changes)


def test_a_format_that_is_not_known():
    own = np.zeros(64 * 48 * 2, np.uint8)
    with pytest.raises(WrongSizeError, match="64x48 GRAY16 in 6144 bytes"):
        copy_raw(own.ctypes.data, Layout(64, 48, "GRAY16", 128, 6144), (64, 48),
                 "DEPTH_1_MM", own)


def test_no_memory_at_all():
    own = np.zeros(64 * 48 * 2, np.uint8)
    with pytest.raises(WrongSizeError, match="a frame of"):
        copy_raw(0, Layout(64, 48, "DEPTH_1_MM", 128, 128 * 48), (64, 48), "DEPTH_1_MM",
                 own)


def test_formats_have_names():
    assert format_name(100) == "DEPTH_1_MM"
    assert format_name(-3) == "format -3"
    assert format_number("YUYV") == 205
