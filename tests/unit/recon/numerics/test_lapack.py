import numpy as np
from scipy.linalg import lapack

from denseface.recon.numerics.lapack import dpbsv


def test_it_is_scipys_own():
    band, right = np.array([[0, -1, -1], [2, 2, 2]], float), np.array([1.0, 0, 1])
    ours, theirs = dpbsv(band, right), lapack.dpbsv(band, right)
    np.testing.assert_array_equal(ours[1], theirs[1])
    np.testing.assert_allclose(ours[1], 1)
