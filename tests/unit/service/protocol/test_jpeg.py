"""A JPEG's size is known, and held against its header, before anyone decodes it."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from denseface.service.errors import LocalProtocolError, RemoteProtocolError
from denseface.service.protocol.jpeg import jpeg_size
from denseface.service.protocol.payload import MAX_JPEG_BYTES, MAX_PREVIEW_SIDE, PreviewHeader
from tests.unit.service.faces import jpeg

FILE = jpeg(40, 30)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (40, 30), (640, 480)])
def test_the_size_is_read_without_decoding(width, height):
    assert jpeg_size(jpeg(width, height)) == (width, height)
    grey = cv2.imencode(".jpg", np.zeros((height, width), np.uint8))[1].tobytes()
    assert jpeg_size(grey) == (width, height)


def test_the_noisiest_picture_fits():
    assert len(jpeg(MAX_PREVIEW_SIDE, 480)) <= MAX_JPEG_BYTES


@pytest.mark.parametrize(("data", "words"), [
    (b"", "does not begin"),
    (b"\x89PNG" + FILE[4:], "does not begin"),
    (FILE[:12], "no frame header"),
    (FILE[:2] + b"\0" + FILE[3:], "no marker at byte 2"),
    (FILE[:2] + b"\xff\xda\0\2" + FILE[2:], "no frame header"),
    (FILE[:FILE.index(b"\xff\xc0") + 6], "cut short"),
    (FILE.replace(b"\xff\xc0\0\x11\x08", b"\xff\xc0\0\x11\x0c"), "3 channels of 12 bits"),
    (cv2.imencode(".jpg", np.zeros((4, 4), np.uint8), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1]
     .tobytes(), "no baseline JPEG"),
], ids=lambda value: value if isinstance(value, str) else "")
def test_what_is_no_such_picture_is_named(data, words):
    with pytest.raises(ValueError, match=words):
        jpeg_size(data)
    if data:
        with pytest.raises(LocalProtocolError, match=words):
            PreviewHeader.of_jpeg(data, 0)


@given(st.binary(max_size=100), st.integers(0, len(FILE) - 1))
@settings(deadline=None)
def test_garbage_is_a_value_error_or_a_size(garbage, at):
    for data in (garbage, FILE[:at] + garbage + FILE[at + len(garbage):]):
        try:
            width, height = jpeg_size(data)
        except ValueError:
            continue
        assert 0 <= width < 2**16 > height >= 0


def test_a_picture_of_another_size_than_its_header_says_is_refused():
    header, arrays = PreviewHeader.of_jpeg(FILE, 0)
    header.check(arrays)
    lies = header.model_copy(update={"width": 41})
    with pytest.raises(RemoteProtocolError, match="has 40 x 30 pixels, its header says 41 x 30"):
        lies.check(arrays)
    with pytest.raises(RemoteProtocolError, match="does not begin as a JPEG"):
        header.check({"jpeg": np.zeros(len(FILE), np.uint8)})


@pytest.mark.parametrize("fields", [
    {"encoding": "jpeg"}, {"jpeg_bytes": 9}, {"encoding": "png", "jpeg_bytes": 9},
    {"encoding": "jpeg", "jpeg_bytes": MAX_JPEG_BYTES + 1}, {"encoding": "jpeg", "jpeg_bytes": 0}])
def test_the_encoding_and_the_size_of_its_bytes_go_together(fields):
    with pytest.raises(ValidationError):
        PreviewHeader(width=4, height=3, timestamp_us=0, **fields)
