"""A fresh process is warm before its first frame."""

import numba

from recon import _gridding, _image_kernels, _kernels, _uncertainty_kernels, reconstruct, warm


def compiled():
    """For which types each kernel stands compiled."""
    return {(module.__name__, name): list(one.signatures)
            for module in (_gridding, _image_kernels, _kernels, _uncertainty_kernels)
            for name, one in vars(module).items()
            if isinstance(one, numba.core.registry.CPUDispatcher)}


def test_once_warm_a_frame_compiles_nothing(shot):
    warm()
    before = compiled()
    assert len(before) >= 8
    reconstruct(shot.frame)
    assert compiled() == before
