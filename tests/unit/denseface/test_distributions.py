"""denseface-core and its extras, denseface, and a client that has three packages."""

import json
import runpy

import pytest
from packaging.requirements import Requirement

import denseface
from denseface.errors import MissingPackageError
from denseface.missing import EXTRAS, explained
from denseface.service.export import FORMATS
from tests.distributions import CHECKOUT, CORE, REPOSITORY, WHOLE, required, run_with, top_modules
from tests.unit.service.faces import jpeg
from tests.unit.service.fake_hub import fake_hub
from tests.waiting import LIMIT_S

PARTS = {"client", "hub", "worker", "capture", "open3d", "completion"}
"""Extras for machines that do less than all; `denseface` has all of them."""
WORK = {"dev", "docs"}
"""Extras for who works on denseface, from a checkout."""


def test_the_whole_is_all_of_the_core_of_the_same_version():
    pinned = f"denseface-core[{{}}]=={denseface.__version__}"
    assert WHOLE["version"] == denseface.__version__
    assert WHOLE["dependencies"] == [pinned.format("all")]
    more = CORE["optional-dependencies"].keys() - PARTS - WORK - {"all"}
    assert WHOLE["optional-dependencies"] == {name: [pinned.format(name)] for name in more}
    assert WHOLE["requires-python"] == CORE["requires-python"]
    every, = map(Requirement, CORE["optional-dependencies"]["all"])
    assert every.extras == PARTS - {"client"}


def test_the_core_is_made_of_the_checkout():
    script = runpy.run_path(str(REPOSITORY / "script/core_project.py"))
    made = script["core_project"]((REPOSITORY / "pyproject.toml").read_text())
    assert made == (REPOSITORY / "distributions/core/pyproject.toml").read_text(), "script/lock"


def test_a_checkout_is_the_whole():
    def parts(*extras):
        named = map(Requirement, (one for extra in extras
                                  for one in CHECKOUT["optional-dependencies"][extra]))
        return {one for each in named for one in (
            parts(*each.extras) if each.name == "denseface" else {str(each)})}

    assert {str(Requirement(one)) for one in CHECKOUT["dependencies"]} == {
        str(Requirement(one)) for one in CORE["dependencies"]} | parts("all")


def test_a_client_asks_for_three_packages():
    assert {Requirement(one).name for one in CORE["dependencies"]} == {
        "numpy", "pydantic", "pyzmq"}
    assert CORE["optional-dependencies"]["client"] == []


def test_a_missing_module_is_said_by_the_extra_that_has_it():
    for module, (package, extra) in EXTRAS.items():
        names = {Requirement(one).name for one in CORE["optional-dependencies"][extra]}
        assert package in names, module
    with pytest.raises(MissingPackageError, match=r"'denseface-core\[hub\]'") as caught, explained(
            "hub"):
        raise ModuleNotFoundError("No module named 'cv2'", name="cv2.aruco")
    assert caught.value.name == "cv2"
    with pytest.raises(ModuleNotFoundError, match="colorama") as caught, explained():
        raise ModuleNotFoundError("No module named 'colorama'", name="colorama")
    assert not isinstance(caught.value, MissingPackageError)


ROLES = {
    "hub": ["denseface.service.daemons.hub", "denseface.service.monitoring.prometheus",
            "denseface.service.monitoring.http_server", "prometheus_client"],
    # A capture process's is this and the binding of OpenNI2, imported where a sensor is opened.
    "worker": ["denseface.service.daemons.worker", "denseface.recon.warmup",
               "denseface.service.daemons.capture", "denseface.service.daemons.sensor",
               "denseface.service.gate.frame_judge"],
    "kiosk": ["denseface.service.kiosk.process", "denseface.service.kiosk.conductor.mirror_feed",
              "denseface.service.export.render", "denseface.service.kiosk.links.addresses"],
}


_ROLES = """
import importlib, json, os
import denseface.service.client
status = 0
for more, names in json.loads(sys.argv[1]):
    if not (child := os.fork()):
        known |= set(more)
        for name in names:
            importlib.import_module(name)
        os._exit(0)
    status |= os.waitpid(child, 0)[1]
sys.exit(status != 0)
"""
"""What all roles have is imported once."""


def test_each_role_imports_what_its_extra_brings():
    known = [(sorted(top_modules(required(role))), names) for role, names in ROLES.items()]
    running = run_with(required("client"), _ROLES, json.dumps(known))
    _, error = running.communicate(timeout=LIMIT_S)
    assert (running.returncode, error) == (0, "")
    assert required("capture") == required("worker") | {"primesense"}


_CLIENT = """
address, folder = sys.argv[1:]
import denseface.service.commands.press, denseface.service.tools.follow
from denseface.service.export import FORMATS
from denseface import Client, MissingPackageError, load_face, save_face
import denseface

with Client(address) as client:
    client.press("a1")
    face = client.get("a1")
    outcome = next(client.published(after=0, timeout=30))
    print(client.status().hub_version, client.get_frame("a1").depth.shape, outcome.capture_id)
    for ending in FORMATS:
        try:
            save_face(face, f"{folder}/face{ending}")
        except MissingPackageError as error:
            print(ending, error)
    save_face(face, f"{folder}/face.stl", options=denseface.ExportOptions(
        printing=denseface.Printing("open")))
    again = load_face(f"{folder}/face.npz")
    print((again.dense.points == face.dense.points).all(), len(again.dense))
    for preview in client.previews(timeout=30):
        break
for call in (lambda: preview.image, lambda: denseface.reconstruct,
             lambda: denseface.open_source("openni2:")):
    try:
        call()
    except (MissingPackageError, denseface.CaptureError) as error:
        print(error)
async def follow():
    async with denseface.AsyncClient(address) as client:
        async for face in client.faces(after=0, timeout=30):
            return len(face.dense)
import asyncio
print(asyncio.run(follow()))
"""


def test_a_client_runs_with_three_packages_alone(tmp_path):
    """It presses, fetches, subscribes, and writes and reads files."""
    with fake_hub() as hub:
        hub.frames.add("a1")
        hub.conclude("a1")
        running = run_with(required("client"), _CLIENT, hub.address, tmp_path)
        try:
            hub.wait(lambda: hub.subscribers("preview") > 0)
            hub.jpeg(1, jpeg(16, 12), "s")
        finally:
            said, error = running.communicate(timeout=LIMIT_S)
    assert (running.returncode, error) == (0, "")
    lacking = "{} is not installed: pip install 'denseface-core[{}]' brings what is needed here"
    decoder = lacking.format("opencv-python-headless", "worker")
    drawn = ".stl", ".3mf", ".png", ".webp", ".mp4"
    assert said.splitlines() == [
        "0 (6, 8) a1", *(f"{ending} {decoder}" for ending in drawn), "True 102", decoder,
        decoder, lacking.format("primesense", "capture"), "102"]
    assert {path.suffix for path in tmp_path.iterdir()} == {*FORMATS} - {*drawn[1:]}
    assert (tmp_path / "face.ply").stat().st_size > 2000
