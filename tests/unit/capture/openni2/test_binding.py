"""The binding of OpenNI2 can be imported on every Python, and its enums are what they always were.

Each Python of this machine is asked, without NumPy or anything else but the binding.
"""

import json
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import primesense.utils
import pytest

from tests.waiting import LIMIT_S

_MODULE = Path(__file__).parents[4] / "capture" / "openni2" / "_binding.py"
_PROGRAM = f"""
import ctypes, json, runpy, sys
before = dict(vars(type(ctypes.c_int)))
sys.path.append({str(Path(primesense.utils.__file__).parents[1])!r})
binding = runpy.run_path({str(_MODULE)!r})
assert dict(vars(type(ctypes.c_int))) == before
c_api = binding["c_api"]
enums = [enum for name, enum in vars(c_api).items()
         if isinstance(enum, type) and issubclass(enum, c_api.CEnum) and name != "CEnum"]
for enum in enums:
    assert enum._values_, enum
    for number, member in enum._values_.items():  # as a C int
        assert enum._names_[member] == number, member
        assert getattr(enum, member).value == ctypes.c_int(number).value, member
mode = c_api.OniVideoMode(c_api.OniPixelFormat.ONI_PIXEL_FORMAT_RGB888, 640, 480, 30)
print(json.dumps([len(enums), int(c_api.OniStatus.ONI_STATUS_TIME_OUT), repr(mode.pixelFormat),
                  int(mode.pixelFormat)]))
"""
_EXPECTED = [40, 102, "OniPixelFormat.ONI_PIXEL_FORMAT_RGB888", 200]
"""Enums, a member's number, one of a structure as text and as number."""
_NOT_FOUND = 127
"""Exit status of what pyenv puts in the place of a Python that is not switched on."""


def _pythons(minor: int) -> list[str]:
    """Find those of a version on the path, and where pyenv and uv keep theirs."""
    name = f"python3.{minor}"
    places = [Path(folder) for folder in os.get_exec_path()]
    places += Path.home().glob(f".pyenv/versions/3.{minor}.*/bin")
    places += Path.home().glob(f".local/share/uv/python/cpython-3.{minor}.*/bin")
    if sys.version_info[:2] == (3, minor):
        places.insert(0, Path(sys.base_prefix, "bin"))
    return [found for place in places if (found := shutil.which(name, path=str(place)))]


@pytest.mark.parametrize("minor", range(11, 16))
def test_the_binding_is_the_same_on_every_python(minor):
    for python in _pythons(minor):
        done = subprocess.run(
            [python, "-I", "-S", "-B", "-W", "error", "-c", _PROGRAM],
            capture_output=True, text=True, check=False, timeout=LIMIT_S)
        if done.returncode == _NOT_FOUND or "No module named '_ctypes'" in done.stderr:
            continue
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout) == _EXPECTED
        return
    pytest.skip(f"no python3.{minor} with ctypes on this machine")


def test_a_binding_that_cannot_be_imported_names_itself_and_the_python(monkeypatch):
    monkeypatch.setitem(sys.modules, "primesense", None)
    with pytest.raises(ImportError, match=(
            r"the binding of OpenNI2, primesense, cannot be imported by Python 3\.\d+\.\d+\S*: ")):
        runpy.run_path(str(_MODULE))
