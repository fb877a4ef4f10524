"""Image files as arrays, and those that are refused."""

import struct
import zlib
from contextlib import suppress

import cv2
import numpy as np
import pytest

from denseface.capture.errors import CaptureError, FrameError, UnreadableSourceError
from denseface.capture.image_pair import read_color_image, read_depth_image
from tests.unit.capture.image_pair.files import COLOR, DEPTH, write

METRES = (DEPTH / 1000).astype(np.float32)


@pytest.mark.parametrize(("ending", "image"), [
    (".png", DEPTH), (".tiff", DEPTH), (".tif", METRES), (".exr", METRES), (".npy", DEPTH),
    (".npy", METRES), (".npy", DEPTH.astype(">u2")), (".npy", DEPTH.astype(np.int32)),
    (".npy", METRES.astype(np.float64)), (".npy", np.asfortranarray(DEPTH)),
    (".npy", DEPTH[..., None]),
])
def test_a_depth_is_read_as_it_was_written(tmp_path, ending, image):
    read = read_depth_image(write(tmp_path / f"d{ending}", image))
    assert read.dtype == image.dtype.newbyteorder("=")
    assert read.flags.c_contiguous
    np.testing.assert_array_equal(read, image.reshape(DEPTH.shape))


def test_a_grey_exr_of_three_channels_and_one_of_half_floats_are_read(tmp_path):
    np.testing.assert_array_equal(
        read_depth_image(write(tmp_path / "d.exr", np.dstack([METRES] * 3))), METRES)
    ok, data = cv2.imencode(".exr", METRES, [cv2.IMWRITE_EXR_TYPE, cv2.IMWRITE_EXR_TYPE_HALF])
    assert ok
    (tmp_path / "half.exr").write_bytes(data.tobytes())
    np.testing.assert_allclose(read_depth_image(tmp_path / "half.exr"), METRES, rtol=1e-3)


@pytest.mark.parametrize("ending", [".png", ".webp", ".npy", ".tiff"])
def test_a_colour_image_is_rgb(tmp_path, ending):
    read = read_color_image(write(tmp_path / f"c{ending}", COLOR))
    assert read.dtype == np.uint8
    np.testing.assert_array_equal(read, COLOR)


def test_colour_comes_from_jpeg_grey_alpha_and_16_bits_too(tmp_path):
    jpeg = read_color_image(write(tmp_path / "c.jpg", COLOR)).astype(int)
    assert np.abs(jpeg - COLOR).mean() < 3
    grey = read_color_image(write(tmp_path / "g.png", COLOR[..., 1]))
    np.testing.assert_array_equal(grey, np.dstack([COLOR[..., 1]] * 3))
    alpha = np.dstack([COLOR, np.full(COLOR.shape[:2], 7, np.uint8)])
    np.testing.assert_array_equal(read_color_image(write(tmp_path / "a.png", alpha)), COLOR)
    deep = COLOR.astype(np.uint16) << 8 | 0x7F
    np.testing.assert_array_equal(read_color_image(write(tmp_path / "w.png", deep)), COLOR)


@pytest.mark.parametrize(("name", "image", "found"), [
    ("d.png", COLOR, "has 3 channels, expected a depth image of one"),
    ("d.png", COLOR[..., 0], "has 8 bits a pixel, expected 16 or 32 bits"),
    ("d.npy", DEPTH.astype(bool), r"found bool \(48, 64\)"),
    ("d.npy", DEPTH.astype(np.complex64), r"found complex64"),
    ("d.npy", DEPTH[0], r"found uint16 \(64,\)"),
    ("d.npy", np.zeros((3, 4, 5), np.uint16), r"found uint16 \(3, 4, 5\)"),
    ("d.npy", np.zeros((0, 4), np.uint16), "4x0 pixels, expected sides of 1"),
])
def test_what_is_no_depth_is_refused_in_a_line(tmp_path, name, image, found):
    with pytest.raises(FrameError, match=rf"d\.\w+: .*{found}") as caught:
        read_depth_image(write(tmp_path / name, image))
    assert "\n" not in str(caught.value)


def test_a_float_image_is_no_colour(tmp_path):
    with pytest.raises(FrameError, match="is float32 with 1 channels, expected a colour image"):
        read_color_image(write(tmp_path / "c.tiff", METRES))


@pytest.mark.parametrize("ending", [".png", ".tiff", ".exr", ".npy", ".jpg", ".webp"])
def test_a_file_cut_anywhere_or_damaged_is_an_error_of_ours_and_prints_nothing(
        tmp_path, capfd, ending):
    whole = write(tmp_path / f"whole{ending}", COLOR if ending in (".jpg", ".webp") else
                  METRES if ending == ".exr" else DEPTH).read_bytes()
    path = tmp_path / f"cut{ending}"
    rng = np.random.default_rng(3)
    for end in {0, 1, 3, 8, *range(12, len(whole) - 1, max(1, len(whole) // 25))}:
        path.write_bytes(whole[:end])
        with pytest.raises(CaptureError, match=r"cut\."):
            read_depth_image(path)
    assert capfd.readouterr().err == ""
    for _ in range(40):
        damaged = bytearray(whole)
        for at in rng.integers(0, len(whole), 3):
            damaged[at] ^= 1 << rng.integers(8)
        path.write_bytes(bytes(damaged))
        with suppress(CaptureError):
            read_depth_image(path)
    if ending != ".jpg":  # libjpeg tells of what it could decode nevertheless
        assert capfd.readouterr().err == ""


def png_of(width, height, pixels=b""):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(
            ">I", zlib.crc32(kind + data))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0,
                                                              0, 0))
            + chunk(b"IDAT", zlib.compress(pixels)) + chunk(b"IEND", b""))


@pytest.mark.parametrize(("width", "height"), [(60000, 60000), (16384, 16384), (16385, 1),
                                               (2**31 - 1, 2**31 - 1)])
def test_a_bomb_is_refused_by_its_header(tmp_path, monkeypatch, width, height):
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    (tmp_path / "bomb.png").write_bytes(png_of(width, height, bytes(2**20)))
    with pytest.raises(FrameError, match=rf"bomb\.png: {width}x{height}"):
        read_depth_image(tmp_path / "bomb.png")


def test_headers_that_never_end_are_given_up(tmp_path):
    exr = write(tmp_path / "whole.exr", METRES).read_bytes()
    (tmp_path / "a.exr").write_bytes(exr[:8] + b"x" * 5000)
    (tmp_path / "b.jpg").write_bytes(b"\xff\xd8" + b"\xff" * 2**20)
    empty = struct.pack(">I", 0) + b"abCd" + struct.pack(">I", zlib.crc32(b"abCd"))
    (tmp_path / "c.png").write_bytes(png_of(4, 4)[:33] + empty * 100_001)
    for name, found in (("a.exr", "damaged header"), ("b.jpg", "without a frame"),
                        ("c.png", "more than 100000 chunks")):
        with pytest.raises(UnreadableSourceError, match=found):
            read_depth_image(tmp_path / name)


def test_the_setting_for_pixels_holds_for_each_format(tmp_path):
    for name, image in (("a.png", DEPTH), ("a.tiff", DEPTH), ("a.exr", METRES), ("a.npy", DEPTH)):
        path = write(tmp_path / name, image)
        assert read_depth_image(path, 48 * 64).shape == (48, 64)
        with pytest.raises(FrameError, match=r"64x48 = 3072 pixels, at most 3071 allowed \(DENSE"):
            read_depth_image(path, 48 * 64 - 1)
    for ending in (".jpg", ".webp"):
        with pytest.raises(FrameError, match="at most 3071 allowed"):
            read_color_image(write(tmp_path / f"a{ending}", COLOR), 48 * 64 - 1)


def test_a_pickle_is_never_loaded(tmp_path):
    np.save(tmp_path / "p.npy", np.array([{"a": 1}], object))
    with pytest.raises(CaptureError, match=r"p\.npy: "):
        read_depth_image(tmp_path / "p.npy")


def test_what_is_no_image_file_is_named(tmp_path):
    (tmp_path / "text.png").write_text("hello world")
    with pytest.raises(UnreadableSourceError, match=r"text\.png: not an image: begins with 68 65"):
        read_depth_image(tmp_path / "text.png")
    with pytest.raises(UnreadableSourceError, match=r"none\.png: No such file"):
        read_depth_image(tmp_path / "none.png")
    with pytest.raises(UnreadableSourceError, match="Is a directory"):
        read_color_image(tmp_path)
