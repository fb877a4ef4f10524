"""EXT_meshopt_compression unpacked: what meshoptimizer's own encoder packed, and damaged streams.

`meshopt_vectors.json` is made by tests/unit/service/export/reading/make_vectors.mjs.
"""

import base64
import json
from pathlib import Path

import numpy as np
import pytest

from denseface.service.export.models.meshopt import encode_attributes, encode_triangles, strip_order
from denseface.service.export.reading._meshopt import unpack
from tests.unit.service.export.models.conftest import meshes_to_pack, rows_to_pack

VECTORS = json.loads((Path(__file__).parent / "meshopt_vectors.json").read_text())


@pytest.mark.parametrize("number", range(len(VECTORS)))
def test_streams_of_meshoptimizer_are_unpacked(number):
    told = VECTORS[number]
    expected = np.frombuffer(base64.b64decode(told["decoded"]), np.uint8)
    found = np.frombuffer(unpack(base64.b64decode(told["coded"]), mode=told["mode"],
                                 count=told["count"], stride=told["stride"],
                                 packing=told.get("filter")), np.uint8)
    if told.get("filter"):  # the last bit may be rounded either way
        kind = "<i1" if told["stride"] == 4 else "<i2"
        assert np.abs(found.view(kind).astype(int) - expected.view(kind)).max() <= 1
    else:
        np.testing.assert_array_equal(found, expected)


def test_what_is_packed_here_is_unpacked_here():
    for rows in rows_to_pack():
        assert unpack(encode_attributes(rows), mode="ATTRIBUTES", count=len(rows),
                      stride=rows.shape[1], packing=None) == rows.tobytes()
    for mesh in meshes_to_pack():
        triangles, _ = strip_order(mesh)
        assert unpack(encode_triangles(triangles), mode="TRIANGLES", count=triangles.size,
                      stride=4, packing=None) == triangles.tobytes()


@pytest.mark.parametrize("number", range(len(VECTORS)))
def test_cut_or_longer_streams_are_refused_or_wrong_and_no_more(number):
    told = VECTORS[number]
    whole, rng = base64.b64decode(told["coded"]), np.random.default_rng(number)
    how = {"mode": told["mode"], "stride": told["stride"], "packing": told.get("filter")}
    for data in (b"", whole[:1], whole + b"\0", whole[:len(whole) // 2]):
        with pytest.raises(ValueError):  # noqa: PT011 - what it says is the reader's matter
            unpack(data, count=told["count"], **how)
    with pytest.raises(ValueError, match=r"announced|size"):
        unpack(whole, count=2**24 - 1, **how)
    refused = 0
    for _ in range(20):
        damaged = bytearray(whole)
        damaged[rng.integers(0, len(whole))] ^= 1 << rng.integers(0, 8)
        try:
            unpack(bytes(damaged), count=told["count"], **how)
        except ValueError:
            refused += 1
    assert refused < 20
