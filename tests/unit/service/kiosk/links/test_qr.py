"""QR codes, read by another library than the one that makes them."""

import cv2
import numpy as np
import pytest

from denseface.service.kiosk.links.links import qr_rows


@pytest.mark.parametrize("url", [
    "http://192.168.1.20:8090/d/mKf3vZ0pQx7RwT1uYb9LdAmKf3vZ0pQx",
    "https://[fd00::1234:5678:9abc:def0]:8443/d/____----____----____----____----",
    "https://the-museum-of-faces.example/d/mKf3vZ0pQx7RwT1uYb9LdAmKf3vZ0pQx"])
def test_a_code_says_the_link(url):
    rows = qr_rows(url)
    assert all(len(row) == len(rows) for row in rows)
    dark = np.array([[one == "1" for one in row] for row in rows])
    picture = np.pad(np.where(dark, 0, 255).astype(np.uint8), 4, constant_values=255)
    picture = cv2.resize(picture, None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == url


def test_a_code_is_read_with_a_spot_on_it():
    rows = qr_rows("http://192.168.1.20:8090/d/mKf3vZ0pQx7RwT1uYb9LdAmKf3vZ0pQx")
    dark = np.array([[one == "1" for one in row] for row in rows])
    side = len(rows)
    hidden = round((0.05 * side * side) ** 0.5)
    dark[side // 2:side // 2 + hidden, side // 2:side // 2 + hidden] = False
    picture = np.pad(np.where(dark, 0, 255).astype(np.uint8), 4, constant_values=255)
    picture = cv2.resize(picture, None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    assert "/d/mKf3vZ0pQx7" in cv2.QRCodeDetector().detectAndDecode(picture)[0]
