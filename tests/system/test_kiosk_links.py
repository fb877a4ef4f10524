"""A face is fetched by a telephone: from another network namespace, read by another library."""

import json
import os
import shutil
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import open3d
import pytest

from tests.system.kiosk_pages import RawPage, kiosk_service
from tests.system.running import RECORDINGS
from tests.waiting import LIMIT_S

SOURCE = f"{RECORDINGS / 'frontal_700.oni'}?rate=real"
HERE, THERE = "198.51.100.1", "198.51.100.2"
"""Ends of a cable, of a network for documentation (RFC 5737)."""
FETCH = """
import json, sys, urllib.error, urllib.request
folder, limit_s, *urls = sys.argv[1:]
opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
answers = []
for number, url in enumerate(urls):
    try:
        with opener.open(url, timeout=float(limit_s)) as answer:
            data, status, headers = answer.read(), answer.status, answer.headers
    except urllib.error.HTTPError as error:
        data, status, headers = error.read(), error.code, error.headers
    except OSError as error:
        data, status, headers = str(error).encode(), 0, {}
    open(f"{folder}/{number}", "wb").write(data)
    answers.append([status, {name.lower(): value for name, value in headers.items()}])
print(json.dumps(answers))
"""
Fetch = Callable[..., list[tuple[int, dict[str, str]]]]
"""Takes a folder, for what came, and URLs; gives statuses and headers."""


@pytest.fixture
def fetch_elsewhere() -> Iterator[Fetch]:
    """Gives what fetches URLs from a machine of its own at the end of a cable."""
    if os.geteuid() != 0 or not shutil.which("ip"):
        pytest.skip("a network namespace takes root and ip (iproute2)")
    name = f"df{uuid.uuid4().hex[:8]}"

    def ip(*words: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(["ip", *words], check=False, capture_output=True, text=True)

    if why := ip("netns", "add", name).stderr:
        pytest.skip(f"no network namespaces here: {why}")
    try:
        for words in (
                f"link add {name}a type veth peer name {name}b netns {name}",
                f"address add {HERE}/30 dev {name}a", f"link set {name}a up",
                f"-n {name} address add {THERE}/30 dev {name}b", f"-n {name} link set {name}b up",
                f"-n {name} route add default via {HERE}"):
            if why := ip(*words.split()).stderr:
                pytest.skip(f"no cable between network namespaces here: {why}")

        def fetch(folder: Path, *urls: str) -> list[tuple[int, dict[str, str]]]:
            folder.mkdir()
            done = subprocess.run(
                ["ip", "netns", "exec", name, sys.executable, "-I", "-c", FETCH, folder,
                 str(LIMIT_S), *urls], check=True, capture_output=True, text=True)
            return [(status, headers) for status, headers in json.loads(done.stdout)]

        yield fetch
    finally:
        ip("netns", "delete", name)  # and the cable with it


def test_a_telephone_in_another_network_fetches_a_face_until_it_is_deleted(
        fetch_elsewhere, tmp_path):
    with kiosk_service(SOURCE, tmp_path, "--kiosk-lan", "0.0.0.0:0",
                       "--kiosk-countdown", "0") as (running, url), RawPage(url) as page:
        page.begin()
        page.result()
        page.say("keep")
        keep = page.until("keep")["keep"]
        assert keep["page"].startswith("http://")
        assert not keep["page"].startswith(("http://127.", "http://0.0.0.0"))

        first, *fetched = fetch_elsewhere(
            tmp_path / "kept", keep["page"], *(link["url"] for link in keep["links"]))
        assert (first[0], first[1]["content-type"]) == (200, "text/html; charset=utf-8")
        files = {}
        for number, (link, (status, headers)) in enumerate(
                zip(keep["links"], fetched, strict=True), 1):
            assert status == 200
            assert headers["referrer-policy"] == "no-referrer"
            file = files[link["format"]] = tmp_path / f"face.{link['format']}"
            (tmp_path / "kept" / str(number)).rename(file)
            assert int(headers["content-length"]) == file.stat().st_size
        _check_files(files, page.screen["result"]["dense_points"])

        # The pages for visitors and the operator are not to be had there.
        lan = keep["page"].rpartition("/d/")[0]
        at_home = f"{lan.rpartition(':')[0]}:{url.rpartition(':')[2]}/"
        assert [status for status, _ in fetch_elsewhere(
            tmp_path / "others", at_home, f"{at_home}operator", f"{lan}/", f"{lan}/operator",
            f"{lan}/ws", f"{lan}/static/kiosk.js")] == [0, 0, 404, 404, 404, 404]

        page.say("delete")
        assert page.until("thanks")["thanks"]["deleted"]
        assert [status for status, _ in fetch_elsewhere(
            tmp_path / "deleted", keep["page"], keep["links"][0]["url"])] == [410, 410]
        token = keep["page"].rpartition("/")[2]
        assert token not in running.log.read_text()
        assert not any(token.encode() in path.read_bytes()
                       for path in (tmp_path / "kiosk").rglob("*") if path.is_file())


def _check_files(files: dict[str, Path], dense_points: int) -> None:
    """Read all by Open3D, which has written none of them."""
    cloud = open3d.io.read_point_cloud(str(files["ply"]))
    assert len(cloud.points) == dense_points
    assert cloud.has_colors()
    z = np.asarray(cloud.points)[:, 2]
    assert 600 < np.median(z) < 800, "millimetres from the camera"
    mesh = open3d.io.read_triangle_mesh(str(files["glb"]))
    assert len(mesh.triangles) > dense_points
    extent = np.ptp(np.asarray(cloud.points), axis=0)
    assert (np.abs(np.ptp(np.asarray(mesh.vertices), axis=0) * 1000 - extent) < 1.0).all()
    solid = open3d.io.read_triangle_mesh(str(files["stl"]))
    solid.remove_duplicated_vertices()
    assert solid.is_edge_manifold(allow_boundary_edges=False)  # is_watertight() takes minutes
    assert solid.is_vertex_manifold()
    beyond = np.ptp(np.asarray(solid.vertices), axis=0) - extent
    assert (np.abs(beyond - [10, 10, 3]) < 4).all(), "a plate of 2 mm, 5 mm around the face"
    picture = cv2.imread(str(files["png"]))
    assert picture.shape == (1200, 1200, 3)
