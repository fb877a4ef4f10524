"""The grid for browsers: what is sent of a face comes out again, what is damaged is refused.

`VECTOR` is read by the front end's tests too: both readers are held to one file.
"""

import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from denseface.recon.face import Face, PointCloud
from denseface.service.export.face_grid import encode_face_grid
from tests.face_grid_reader import FaceGrid, read_face_grid
from tests.simulator.sample_face import SAMPLE
from tests.unit.service.faces import small_face

VECTOR = Path(__file__).parents[4] / "service/kiosk/frontend/test/vectors/dome.face"
_HALF_UNIT = 0.005 + 1e-4
"""mm; and what 32 bits round away at 700 mm."""


def bumpy_face(rows: int = 31, columns: int = 22) -> Face:
    """A dome with a hole, a step in depth and spots of colour."""
    face = small_face(rows, columns, 0.5)
    dense, rng = face.dense, np.random.default_rng(5)
    keep = np.hypot(dense.cells[:, 0] - 12, dense.cells[:, 1] - 9) > 3
    points, cells = dense.points[keep], dense.cells[keep]
    points[cells[:, 1] > columns - 6, 2] += 40
    points[:, 2] += rng.normal(0, 0.02, len(points)).astype(np.float32)
    colors = rng.integers(0, 256, (len(points), 3)).astype(np.uint8)
    seeds = rng.normal(0, 60, (len(face.initial), 3)).astype(np.float32)
    return replace(
        face, initial=PointCloud(seeds, colors[:len(seeds)].copy()),
        dense=replace(dense, points=points, cells=cells, colors=colors,
                      normals=dense.normals[keep], sigma=dense.sigma[keep]))


def check(face: Face, read: FaceGrid) -> None:
    """The same face, as near as the page of the format promises."""
    dense = face.dense
    assert np.array_equal(read.cells, dense.cells)
    assert np.abs(read.points - dense.points).max() <= _HALF_UNIT
    assert np.array_equal(read.colors, dense.colors)
    half_code = (dense.sigma.max() / dense.sigma.min()) ** (0.5 / 255)
    assert np.abs(np.log(read.sigma / dense.sigma)).max() <= np.log(half_code) + 1e-5
    assert np.abs(read.seeds - face.initial.points).max() <= _HALF_UNIT
    assert np.array_equal(read.seed_colors, face.initial.colors)


@pytest.mark.parametrize("face", [small_face(), bumpy_face(), bumpy_face(3, 8), small_face(40, 17)])
def test_what_is_sent_comes_out(face: Face) -> None:
    check(face, read_face_grid(encode_face_grid(face)))


def test_the_header_says_what_a_page_needs() -> None:
    face = bumpy_face()
    header = read_face_grid(encode_face_grid(face)).header
    assert header["points"] == len(face.dense)
    assert header["seeds"] == len(face.initial)
    assert header["sigma_mm"] == [face.dense.sigma.min(), face.dense.sigma.max()]
    assert header["spacing_mm"] == face.report.mean_spacing_mm
    assert header["long"] > 0


def test_one_sigma_is_a_range() -> None:
    face = small_face()
    face = replace(face, dense=replace(face.dense, sigma=np.full_like(face.dense.sigma, 0.7)))
    check(face, read_face_grid(encode_face_grid(face)))


def test_a_point_off_the_grid_is_refused() -> None:
    face = small_face()
    points = face.dense.points.copy()
    points[5, 0] += 0.02
    with pytest.raises(ValueError, match="x is not on a grid of 2 mm"):
        encode_face_grid(replace(face, dense=replace(face.dense, points=points)))


def test_a_point_too_far_away_is_refused() -> None:
    face = small_face()
    points = face.dense.points.copy()
    points[5, 2] = 3e6
    with pytest.raises(ValueError, match="beyond"):
        encode_face_grid(replace(face, dense=replace(face.dense, points=points)))


def test_the_vector_of_the_front_end_is_read_as_it_says() -> None:
    expected = json.loads(VECTOR.with_suffix(".json").read_text())
    read = read_face_grid(VECTOR.read_bytes())
    for name in ("cells", "points", "colors", "sigma", "seeds", "seed_colors"):
        assert np.allclose(getattr(read, name), expected[name], atol=1e-4), name


def test_the_vector_is_what_is_written_now() -> None:
    check(bumpy_face(), read_face_grid(VECTOR.read_bytes()))


def test_the_sample_of_the_first_screen_is_whole_and_small() -> None:
    data = SAMPLE.read_bytes()
    read = read_face_grid(data)
    assert len(data) <= 300_000
    assert len(read.points) > 100_000
    assert len(read.seeds) > 10_000


def remade(data: bytes, *, head: Callable[[dict[str, Any]], object] = lambda _: None,
           body: Callable[[bytes], bytes] = lambda body: body) -> bytes:
    """A file with another header or body."""
    length = struct.unpack("<I", data[8:12])[0]
    header = json.loads(data[12:12 + length])
    head(header)
    text = json.dumps(header).encode()
    packed = zlib.compress(body(zlib.decompress(data[12 + length:])))
    return data[:8] + struct.pack("<I", len(text)) + text + packed


def damaged() -> dict[str, bytes]:
    whole = encode_face_grid(bumpy_face())
    return {
        "empty": b"",
        "another file": b"glTF" + whole[4:],
        "another version": whole[:4] + struct.pack("<I", 2) + whole[8:],
        "a header longer than the file": whole[:8] + struct.pack("<I", 2**31) + whole[12:],
        "cut off": whole[:-9],
        "more behind": whole + b"x",
        "a flipped bit": whole[:-5] + bytes([whole[-5] ^ 16]) + whole[-4:],
        "a grid without end": remade(whole, head=lambda h: h.update(rows=2**20, columns=2**20)),
        "more points than places": remade(whole, head=lambda h: h.update(points=10**6)),
        "a point more": remade(whole, head=lambda h: h.update(points=h["points"] + 1)),
        "many seeds": remade(whole, head=lambda h: h.update(seeds=2**22)),
        "a negative count": remade(whole, head=lambda h: h.update(seeds=-1)),
        "no sigma": remade(whole, head=lambda h: h.update(sigma_mm=[0.0, 1.0])),
        "a body too short": remade(whole, body=lambda b: b[:-1]),
        "a body too long": remade(whole, body=lambda b: b + b"x"),
        "an empty support": remade(whole, body=lambda b: b"\0" * 31 * 3 + b[31 * 3:]),
        "a place beyond the columns": remade(whole, body=lambda b: b[:2] + b"\xff" + b[3:]),
    }


@pytest.mark.parametrize("name", damaged())
def test_what_is_damaged_is_refused(name: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - what it says is the reader's matter
        read_face_grid(damaged()[name])


def test_cut_anywhere_is_refused() -> None:
    whole = encode_face_grid(small_face())
    for end in range(len(whole)):
        with pytest.raises(ValueError):  # noqa: PT011
            read_face_grid(whole[:end])
