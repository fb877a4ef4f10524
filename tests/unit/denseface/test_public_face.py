"""What other programs import."""

import subprocess
import sys

import pytest

import denseface


@pytest.mark.parametrize("name", denseface.__all__)
def test_every_public_name_is_there(name):
    assert getattr(denseface, name) is not None
    assert name in dir(denseface)


@pytest.mark.parametrize("name", sorted({*denseface.__all__} - {"__version__"}))
def test_every_public_name_lives_in_the_package(name):
    """Not in a second copy under `capture` or `recon`, which a checkout's folders would give."""
    assert getattr(denseface, name).__module__.startswith("denseface.")


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'denseface' has no attribute 'nothing'"):
        _ = denseface.nothing


def test_importing_it_costs_nothing():
    code = "import sys, denseface; sys.exit(bool({'numpy', 'pydantic', 'zmq'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_clients_load_nothing_of_the_other_processes():
    heavy = {"numba", "cv2", "scipy", "open3d", "sqlite3", "prometheus_client"}
    code = ("import sys; from denseface import AsyncClient, Client\n"
            f"found = {heavy} & set(sys.modules)\nsys.exit(repr(found) if found else 0)")
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
