"""Cutting a mesh off at a level."""

import numpy as np

from tests.simulator.clip import clip_below
from tests.simulator.surface import Surface


def area(surface):
    a, b, c = np.moveaxis(surface.vertices[surface.faces].astype(float), 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_what_is_above_stays_whole_and_what_crosses_is_cut_at_the_level():
    grid = np.linspace(0, 10, 8)
    x, y = np.meshgrid(grid, grid)
    vertices = np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3).astype(np.float32)
    index = np.arange(64).reshape(8, 8)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3),
                            np.stack([b, d, c], -1).reshape(-1, 3)]).astype(np.int32)
    colors = (np.clip(vertices, 0, 10) * 25).astype(np.uint8)
    uv = (vertices[:, :2] / 10)[faces]
    whole = Surface(vertices=vertices, faces=faces, colors=colors, uv=uv,
                    texture=np.zeros((4, 4, 3), np.uint8), plain=np.zeros(len(faces), bool))
    cut = clip_below(whole, 6.3)
    used = cut.vertices[cut.faces]
    assert used[..., 1].max() <= 6.3 + 1e-5
    assert abs(area(cut) - 63.0) < 1e-3
    # Texture coordinates, colours and winding follow.
    np.testing.assert_allclose(cut.uv * 10, used[..., :2], atol=1e-4)
    np.testing.assert_allclose(cut.colors[cut.faces][..., :2], used[..., :2] * 25, atol=1.5)
    normal = np.cross(used[:, 1] - used[:, 0], used[:, 2] - used[:, 0])[:, 2]
    assert (normal >= -1e-6).all()
