"""What `denseface-core` needs for a purpose, and which of its extras brings it."""

from collections.abc import Iterator
from contextlib import contextmanager

from denseface.errors import MissingPackageError

__all__ = ["BASE", "EXTRAS", "explained", "missing"]

BASE = "numpy", "pydantic", "pyzmq"
"""Packages that are always there."""
EXTRAS = {
    "cryptography": ("cryptography", "batch"),
    "cv2": ("opencv-python-headless", "worker"),
    "dask": ("dask", "batch"),
    "distributed": ("distributed", "batch"),
    "matplotlib": ("matplotlib", "notebook"),
    "numba": ("numba", "worker"),
    "open3d": ("open3d", "open3d"),
    "primesense": ("primesense", "capture"),
    "prometheus_client": ("prometheus-client", "hub"),
    "psutil": ("psutil", "kiosk"),
    "pyarrow": ("pyarrow", "batch"),
    "rerun": ("rerun-sdk", "rerun"),
    "rich": ("rich", "batch"),
    "scipy": ("scipy", "worker"),
    "segno": ("segno", "kiosk"),
    "shtab": ("shtab", "completion"),
    "starlette": ("starlette", "kiosk"),
    "structlog": ("structlog", "hub"),
    "threadpoolctl": ("threadpoolctl", "worker"),
    "trimesh": ("trimesh", "notebook"),
    "uvicorn": ("uvicorn", "kiosk"),
    "websockets": ("websockets", "kiosk"),
}
"""Module -> the package that has it, and the extra by which it is installed."""


@contextmanager
def explained(extra: str = "") -> Iterator[None]:
    """Say by which extra a module is installed that is missing within the block.

    Parameters
    ----------
    extra : the one to name, where the purpose has another than the module

    Raises
    ------
    MissingPackageError
        In place of ModuleNotFoundError, of the modules in `EXTRAS`.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if isinstance(error, MissingPackageError) or (told := missing(error, extra)) is None:
            raise
        raise told from error


def missing(error: ImportError, extra: str = "") -> MissingPackageError | None:
    """Give what `explained` raises; None of a module that no extra has."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRAS:
        return None
    package, usual = EXTRAS[module]
    return MissingPackageError(
        f"{package} is not installed: pip install 'denseface-core[{extra or usual}]' brings what "
        "is needed here", name=module)
