import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from denseface.capture.oni.depth_codec import MAX_VALUES, compress_depth


def expanded(data: bytes, count: int) -> np.ndarray:
    """Undo the codec, byte by byte as its description says."""
    ends = 2 + 2 * int.from_bytes(data[:2], "little")
    table = np.frombuffer(data[2:ends], "<u2")
    ranks = [int.from_bytes(data[ends:ends + 2], "little")]
    rest = iter(data[ends + 2:])

    def large() -> None:
        first = next(rest)
        ranks.append(ranks[-1] - (first - 192) if first & 0x80 else first << 8 | next(rest))

    for byte in rest:
        if byte == 0xFF:
            large()
        elif byte >= 0xE0:
            ranks.extend([ranks[-1]] * (2 * (byte & 0xF)))
        else:
            ranks.append(ranks[-1] - ((byte >> 4) - 6))
            if byte & 0xF == 0xF:
                large()
            elif byte & 0xF != 0xD:
                ranks.append(ranks[-1] - ((byte & 0xF) - 6))
    assert len(ranks) == count
    return table[ranks]


@given(st.data())
@settings(deadline=None, max_examples=200)
def test_what_is_compressed_can_be_read(data):
    most = data.draw(st.sampled_from([1, 2, 8, 60, 300, 65535]))
    depth = data.draw(arrays(np.uint16, array_shapes(min_dims=2, max_dims=2, max_side=40),
                             elements=st.integers(0, most)))
    depth = np.repeat(depth, data.draw(st.sampled_from([1, 2, 37])), axis=1)
    assert (expanded(compress_depth(depth), depth.size) == depth.ravel()).all()


@pytest.mark.parametrize("steps", [[0], [6], [7], [63], [64], [0, 6], [7, 0], [0, 0, 64, 0]])
def test_each_kind_of_step_at_each_place_of_a_byte(steps):
    rng = np.random.default_rng(3)
    walk = 500 + np.cumsum(rng.permutation(np.resize(steps, 77)) * rng.choice([-1, 1], 77))
    # Every value occurs, so that ranks are values.
    depth = np.concatenate([walk, np.arange(walk.min(), walk.max() + 1)])[None].astype(np.uint16)
    assert (expanded(compress_depth(depth), depth.size) == depth.ravel()).all()


def test_more_different_depths_than_the_codec_can_tell_apart():
    depth = np.arange(MAX_VALUES + 1, dtype=np.uint16).reshape(64, -1)
    with pytest.raises(ValueError, match="32768 different depths, at most 32767"):
        compress_depth(depth)
    assert (expanded(compress_depth(depth[:-1]), depth[:-1].size) == depth[:-1].ravel()).all()
