import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from denseface.recon.numerics.threads import one_blas_thread


def blas_threads() -> set[int]:
    np.linalg.norm(np.ones((4, 4)) @ np.ones((4, 4)))
    return {library["num_threads"] for library in threadpool_info()
            if library["user_api"] == "blas"}


def test_one_thread_inside_and_as_before_outside():
    with threadpool_limits(2, "blas"):
        before = blas_threads()
        assert one_blas_thread(blas_threads)() == {1}
        assert blas_threads() == before


def test_arguments_results_and_errors_pass_through():
    assert one_blas_thread(divmod)(7, 2) == (3, 1)
    with pytest.raises(ZeroDivisionError):
        one_blas_thread(divmod)(7, 0)
