"""How script/docs reads this house's docstrings; the rest of the site is checked by its build."""

import importlib.util
from inspect import getdoc
from pathlib import Path

import pytest

from denseface import Client, DenseCloud, Length, reconstruct
from denseface.recon.measurement import Measurements

_EXTENSIONS = Path(__file__).resolve().parents[3] / "docs" / "extensions"


@pytest.fixture(scope="module")
def as_numpy():
    pytest.importorskip("sphinx")
    spec = importlib.util.spec_from_file_location(
        "house_docstrings", _EXTENSIONS / "house_docstrings.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.as_numpy


def test_a_description_goes_below_its_name(as_numpy):
    assert as_numpy([
        "Say.", "", "Parameters", "----------", "key, hub_key : files of", "    both",
        "**more : the rest", "", "Returns", "-------", "Face", "    All of it: both clouds."]) == [
        "Say.", "", "", "", "Parameters", "----------", "key, hub_key", "    files of", "    both",
        "**more", "    the rest", "", "", "Returns", "-------", "Face",
        "    All of it: both clouds."]


def test_what_is_said_of_all_parameters_goes_before_them(as_numpy):
    lines = as_numpy(getdoc(Client).splitlines())
    every = next(at for at, line in enumerate(lines) if line.startswith("Every call raises"))
    assert every < lines.index("Parameters") < lines.index("address") < lines.index("Raises")


@pytest.mark.parametrize("thing", [Client, DenseCloud, Length, Measurements, reconstruct])
def test_no_word_is_lost(as_numpy, thing):
    lines = getdoc(thing).splitlines()
    before = " ".join(lines).replace(" : ", " ").split()
    assert sorted(" ".join(as_numpy(lines)).split()) == sorted(before)
