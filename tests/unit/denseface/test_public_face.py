"""What other programs import."""

import ast
import builtins
import copy
import inspect
import re
import subprocess
import sys
from importlib import resources
from pathlib import Path

import pytest

import denseface
from denseface import errors
from denseface.service import errors as service_errors

PUBLIC = sorted({*denseface.__all__} - {"__version__"})
ALIASES = {"Published"}
"""Names of types that no class has."""
UNITS = re.compile(r"\b(mm|pixels|seconds|microseconds|micrometres|unitless|degrees)\b")


ERRORS = [name for name in PUBLIC if name.endswith("Error")]


def calls():
    """Give the name and the object of each public call."""
    for name in PUBLIC:
        one = getattr(denseface, name)
        if inspect.isfunction(one):
            yield name, one
        elif inspect.isclass(one) and name not in ERRORS:
            yield name, one
            for base in one.__mro__:
                if base.__module__.startswith("denseface."):
                    for member, found in vars(base).items():
                        function = getattr(found, "__func__", getattr(found, "fget", found))
                        if not member.startswith("_") and inspect.isfunction(function):
                            yield f"{name}.{member}", function


@pytest.mark.parametrize("name", denseface.__all__)
def test_every_public_name_is_there(name):
    assert getattr(denseface, name) is not None
    assert name in dir(denseface)


@pytest.mark.parametrize("name", sorted({*PUBLIC} - ALIASES))
def test_every_public_name_lives_in_the_package(name):
    """Not in a second copy under `capture` or `recon`, which a checkout's folders would give."""
    assert getattr(denseface, name).__module__.startswith("denseface.")


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'denseface' has no attribute 'nothing'"):
        _ = denseface.nothing


def test_importing_it_costs_nothing():
    code = "import sys, denseface; sys.exit(bool({'numpy', 'pydantic', 'zmq'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(("client", "spared"), [("Client", {"asyncio"}), ("AsyncClient", set())])
def test_the_clients_load_nothing_of_the_other_processes(client, spared):
    heavy = {"numba", "cv2", "scipy", "open3d", "sqlite3", "prometheus_client",
             "structlog"} | spared
    code = (f"import sys; from denseface import {client}\n"
            f"found = {heavy} & set(sys.modules)\nsys.exit(repr(found) if found else 0)")
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_type_checkers_and_import_star_see_the_same_names():
    tree = ast.parse(Path(denseface.__file__).read_text())
    checked = {}
    for block in tree.body:
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING":
            for one in block.body:
                if isinstance(one, ast.ImportFrom):
                    checked |= {alias.name: one.module.removeprefix("denseface.")
                                for alias in one.names}
    assert checked == denseface._MODULES
    assert sorted({*checked, "__version__"}) == denseface.__all__
    assert resources.files("denseface").joinpath("py.typed").is_file()


def test_all_errors_have_one_base_and_are_documented():
    for name in ERRORS:
        assert issubclass(getattr(denseface, name), denseface.DensefaceError), name
        assert getattr(denseface, name).__doc__
    bases = {name for name in ERRORS
             if getattr(denseface, name).__bases__ == (denseface.DensefaceError,)}
    assert bases <= set(re.findall(r"`(\w+)`", errors.__doc__))
    page = (Path(__file__).resolve().parents[3] / "docs" / "python.md").read_text()
    assert {*ERRORS} <= set(re.findall(r"`(\w+Error)`", page))


MADE = {"PressRefusedError": ("press refused: too far", "quality", ("too_far",), "come closer"),
        "CaptureFailedError": ("a1", "NoFaceError", "no face"),
        "DamagedFaceError": ("a1", "cut short")}
"""What errors are made of that take more than a text."""


@pytest.mark.parametrize("name", [*ERRORS, "DamagedFaceError"])
def test_an_error_comes_whole_out_of_another_process(name):
    """As `concurrent.futures` brings it; one that cannot be made again would break the pool."""
    error = getattr(service_errors if name == "DamagedFaceError" else denseface, name)(
        *MADE.get(name, ("x.npz: cut short",)))
    again = copy.copy(error)  # as pickling does it, by __reduce_ex__
    assert type(again) is type(error)
    assert (str(again), again.args, vars(again)) == (str(error), error.args, vars(error))


def test_every_error_that_a_call_documents_is_public():
    found = {}
    for name, call in calls():
        doc = inspect.getdoc(call) or ""
        raised = doc.partition("Raises\n------\n")[2]
        for error in re.findall(r"\b[A-Z]\w+(?:Error|Exception)\b", raised):
            found.setdefault(error, name)
    assert len(found) > 15
    missing = {error: name for error, name in found.items()
               if not hasattr(denseface, error) and not hasattr(builtins, error)}
    assert not missing


def test_every_public_call_is_documented():
    found = {name: inspect.getdoc(call) for name, call in calls()}
    assert {"Client.press", "RgbdFrame.with_note", "Settings.of", "load_frame"} < found.keys()
    assert [name for name, doc in found.items() if not doc] == []


@pytest.mark.parametrize("name", ["CameraModel", "DenseCloud", "DepthMeaning", "Face", "PointCloud",
                                  "Report", "RgbdFrame"])
def test_what_holds_numbers_says_their_units(name):
    assert UNITS.search(inspect.getsource(getattr(denseface, name)))


@pytest.mark.parametrize("name", ["save_face", "save_frame"])
def test_the_thing_comes_before_its_path(name):
    first, second, *_ = inspect.signature(getattr(denseface, name)).parameters
    assert (first, second) == (name.removeprefix("save_"), "path")
    assert next(iter(inspect.signature(getattr(denseface, f"load_{first}")).parameters)) == "path"
