"""The loops of shape from shading against NumPy."""

import numpy as np
import pytest

from denseface.recon.detail._shading_kernels import (
    Iterate,
    ShadingSystem,
    apply_jacobian,
    apply_jacobian_transpose,
    apply_weights,
    brightness_image,
    conjugate_gradient_step,
    grid_points,
    masked_brightness,
    shading_residuals,
)

SHAPE = 23, 31


@pytest.fixture
def rng():
    return np.random.default_rng(8)


def image(rng, scale=1.0):
    return (scale * rng.standard_normal(SHAPE)).astype(np.float32)


def basis(dz_dx, dz_dy):
    z = 1 / np.sqrt(1 + dz_dx**2 + dz_dy**2)
    x, y = dz_dx * z, dz_dy * z
    return np.stack([np.ones_like(z), x, y, z, x * x, x * y, y * y, x * z, y * z], axis=-1)


def test_one_product_is_the_other_s_transpose(rng):
    by_x, by_y, heights, values = (image(rng) for _ in range(4))
    for one in (values, by_x, by_y):  # the outermost places are left alone
        one[[0, -1]] = one[:, [0, -1]] = 0
    heights[[0, -1]] = heights[:, [0, -1]] = 0
    along, back = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.float32)
    apply_jacobian(heights, by_x, by_y, along)
    apply_jacobian_transpose(values, by_x, by_y, back)
    assert np.vdot(along, values) == pytest.approx(np.vdot(heights, back), rel=1e-4)
    expected = (by_x * np.gradient(heights, axis=1) + by_y * np.gradient(heights, axis=0)) * 2
    np.testing.assert_allclose(along[1:-1, 1:-1], expected[1:-1, 1:-1], rtol=1e-4, atol=1e-5)


def test_residuals_and_how_shading_changes_with_slopes(rng):
    dz_dx, dz_dy = image(rng, 0.7), image(rng, 0.7)
    lighting = np.array([0.8, 0.2, -0.3, 0.4, 0.1, -0.1, 0.05, 0.1, 0.05], np.float32)
    shade = basis(dz_dx.astype(float), dz_dy.astype(float)) @ lighting
    brightness = (shade * np.exp(image(rng, 0.1))).astype(np.float32)
    residuals, by_dx, by_dy = shading_residuals(brightness, dz_dx, dz_dy, lighting, 0.1)
    usual = shade > 0.12
    assert usual.mean() > 0.9
    np.testing.assert_allclose(residuals[usual], np.log(brightness / shade)[usual], atol=5e-3)
    for found, way in ((by_dx, (1e-4, 0)), (by_dy, (0, 1e-4))):
        more, less = (np.log(basis(dz_dx + s * way[0], dz_dy + s * way[1]) @ lighting)
                      for s in (1.0, -1.0))
        np.testing.assert_allclose(found[usual], ((more - less) / 2e-4)[usual], atol=2e-3)


def test_shading_below_the_least_is_not_divided_by():
    flat, dark = np.zeros((3, 3), np.float32), np.full((3, 3), 0.01, np.float32)
    out = shading_residuals(dark, flat, flat, np.zeros(9, np.float32), 0.1)
    np.testing.assert_allclose(out.residuals, 2 * (0.01 - 0.1) / 0.11, rtol=1e-5)
    assert np.isfinite(np.stack(out)).all()


def test_points_and_brightness_are_of_the_same_places(rng):
    weight = (rng.random(SHAPE) < 0.6).astype(np.float32)
    heights = image(rng)
    xs, ys = np.arange(SHAPE[1]) * 2.0 - 5, np.arange(SHAPE[0]) * 2.0 + 3
    points = grid_points(weight, xs, ys, heights)
    rows, columns = np.nonzero(weight)
    np.testing.assert_allclose(points, np.column_stack([xs[columns], ys[rows],
                                                        heights[rows, columns]]), rtol=1e-6)
    colors = rng.integers(0, 256, (len(points), 3)).astype(np.uint8)
    seen = rng.random(len(points)) < 0.8
    table = rng.random((3, 256)).astype(np.float32)
    lowered = weight.copy()
    brightness = brightness_image(colors, seen, table, 250, lowered)
    counts = seen & (colors.max(axis=1) < 250)
    expected = table[np.arange(3), colors].sum(axis=1) * counts
    np.testing.assert_allclose(brightness[rows, columns], expected, rtol=1e-6)
    np.testing.assert_array_equal(lowered[rows, columns], counts)
    assert not brightness[weight == 0].any()
    assert not lowered[weight == 0].any()


def test_only_what_is_seen_has_a_brightness(rng):
    brightness, weight = image(rng), np.maximum(image(rng), 0)
    found = masked_brightness(brightness, weight)
    np.testing.assert_array_equal(found[..., 0], weight > 0)
    np.testing.assert_array_equal(found[..., 1], np.where(weight > 0, brightness, 0))


def test_weights_fall_with_the_energy_around(rng):
    residuals, by_x, by_y = (image(rng) for _ in range(3))
    weight, energy = (np.abs(image(rng)) for _ in range(2))
    energy[:5] *= 1e-3
    changed = [one.copy() for one in (residuals, by_x, by_y)]
    apply_weights(ShadingSystem(*changed), weight, energy, 0.1, 9.0, 1.5)
    root = np.sqrt(9 * weight / np.maximum(energy / 0.01, 1))
    for found, before, factor in zip(changed, (residuals, by_x, by_y), (1, 1 / 3, 1 / 3),
                                     strict=True):
        np.testing.assert_allclose(found, before * root * factor, rtol=1e-4, atol=1e-6)


def test_conjugate_gradients_end_at_the_solution(rng):
    """Without a blur the preconditioner is the variance: A^T A x + x / variance = A^T r."""
    shape, variance = (7, 8), 2.0
    by_x, by_y, values = (np.float32(0.3) * image(rng)[:7, :8] for _ in range(3))
    columns = []
    for k in range(by_x.size):
        unit, along, back = np.zeros(shape, np.float32), np.zeros(shape, np.float32), np.zeros(
            shape, np.float32)
        unit.flat[k] = 1
        apply_jacobian(unit, by_x, by_y, along)
        apply_jacobian_transpose(along, by_x, by_y, back)
        columns.append(back.ravel())
    state = Iterate(*(np.zeros(shape, np.float32) for _ in range(4)))
    apply_jacobian_transpose(values, by_x, by_y, state.residual)
    matrix = np.array(columns, float).T + np.eye(by_x.size) / variance
    expected = np.linalg.solve(matrix, state.residual.ravel()).reshape(shape)
    norm, norms = 1.0, []
    for _ in range(40):
        norm = conjugate_gradient_step(state, state.residual.copy(), variance, by_x, by_y, norm)
        norms.append(norm)
        if norm < 1e-9 * norms[0]:
            break
    np.testing.assert_allclose(state.heights, expected, atol=1e-4)
    done = state._replace(residual=np.zeros(shape, np.float32))
    assert conjugate_gradient_step(done, state.residual, 1.0, by_x, by_y, 1.0) == 0
