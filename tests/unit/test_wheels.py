"""script/wheels, which says what has a wheel for a machine; the index itself is not asked here."""

import importlib.util
from pathlib import Path

import pytest

_PATH = Path(__file__).resolve().parents[2] / "script" / "wheels.py"
_SPEC = importlib.util.spec_from_file_location("wheels", _PATH)
wheels = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(wheels)

GLIBCS = [f"manylinux_2_{minor}_aarch64" for minor in range(36, 4, -1)]


def package(*names):
    return {"name": "a", "version": "1.0",
            "wheels": [{"url": f"https://example.org/x/a-1.0-{name}.whl", "size": 3_450_000}
                       for name in names]}


@pytest.mark.parametrize(("names", "said"), [
    (["cp311-cp311-manylinux_2_27_aarch64.manylinux_2_28_aarch64"], "1.0, 3.5 MB, 2.27"),
    (["cp311-cp311-manylinux2014_aarch64"], "1.0, 3.5 MB, 2.17"),
    (["cp37-abi3-manylinux_2_28_aarch64"], "1.0, 3.5 MB, 2.28"),
    (["cp311-cp311-manylinux_2_35_aarch64", "cp312-cp312-manylinux_2_17_aarch64"],
     "1.0, 3.5 MB, 2.35"),
    (["cp311-cp311-manylinux_2_39_aarch64"], "1.0, source, **no wheel**"),
    (["cp311-cp311-manylinux_2_17_x86_64"], "1.0, source, **no wheel**"),
    (["cp312-cp312-manylinux_2_17_aarch64"], "1.0, source, **no wheel**"),
    ([], "1.0, source, **no wheel**"),
])
def test_the_wheel_is_the_one_that_pip_would_take(names, said):
    one = package(*names)
    assert wheels._said(one, wheels._best(one, (3, 11), GLIBCS), "a") == said


def test_what_installs_from_source_is_no_fault():
    one = package()
    assert wheels._said(one, wheels._best(one, (3, 11), GLIBCS), "primesense") == "1.0, source"
    assert wheels._said(None, None, "a") == "-"


def test_the_wheel_for_any_machine_is_found():
    best = wheels._best(package("py3-none-any"), (3, 11), GLIBCS)
    assert best["name"] == "a-1.0-py3-none-any.whl"
