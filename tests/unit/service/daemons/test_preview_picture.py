"""The picture of a preview, as the sensor's process sends it."""

import cv2
import numpy as np
import pytest

from denseface.capture import RgbdFrame
from denseface.capture.frame import DepthMeaning
from denseface.service.daemons.preview_picture import preview_jpeg
from denseface.service.protocol.jpeg import jpeg_size
from denseface.service.protocol.payload import MAX_JPEG_BYTES
from tests.unit.frames import calibration, camera, frame


def seen(color):
    height, width = color.shape[:2]
    return frame(np.zeros((6, 8), np.uint16), color,
                 calibration(depth=camera(8, 6, 10.0), color=camera(width, height, 600.0)))


def pixels(data):
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR),
                        cv2.COLOR_BGR2RGB).astype(int)


@pytest.mark.parametrize(("shape", "small"), [
    ((480, 640), (640, 480)), ((1024, 1280), (640, 512)), ((240, 320), (320, 240)),
    ((7, 10), (10, 7)), ((1000, 3), (1, 500)), ((641, 641), (320, 320)), ((1, 5000), (625, 1))])
def test_it_is_small_enough_to_send(shape, small):
    data = preview_jpeg(seen(np.full((*shape, 3), (1, 100, 255), np.uint8)))
    assert jpeg_size(data) == small
    assert np.abs(pixels(data) - (1, 100, 255)).max() < 6


def test_a_pixel_is_the_mean_of_those_it_covers():
    rng = np.random.default_rng(2)
    coarse = cv2.resize(rng.integers(0, 256, (24, 32, 3), np.uint8), (1280, 960))
    image = coarse.copy()
    image.flags.writeable = False  # as those of a frame are
    means = image.reshape(480, 2, 640, 2, 3).mean((1, 3))
    assert np.abs(pixels(preview_jpeg(seen(image))) - means).mean() < 3


def test_a_picture_of_noise_is_sent_too():
    noise = np.random.default_rng(1).integers(0, 256, (640, 640, 3), np.uint8)
    assert len(preview_jpeg(seen(noise))) <= MAX_JPEG_BYTES


@pytest.mark.parametrize("unit_um", [1000, 100])
def test_without_colour_the_depth_is_shaded_as_a_relief(unit_um):
    v, u = np.mgrid[:480, :640]
    mm = 900 - np.sqrt(np.maximum(150.0**2 - (u - 320.0)**2 - (v - 240.0)**2, 0))
    depth = np.round(mm * 1000 / unit_um).astype(np.uint16)
    depth[:, :100] = 0
    calib = calibration(depth=camera(640, 480, 575.0), color=camera(640, 480, 575.0))
    shown = pixels(preview_jpeg(RgbdFrame(
        depth, None, 1, 1, calib, depth_meaning=DepthMeaning(unit_um=unit_um))))
    assert shown.shape == (240, 320, 3)
    assert shown[:, :40].max() < 10  # no reading is black
    above, below = shown[90, 160].mean(), shown[150, 160].mean()
    assert above > shown[5, 300].mean() > below  # lit from above
    assert below > 20
