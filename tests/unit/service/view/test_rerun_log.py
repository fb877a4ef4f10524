"""What is logged, read back by rerun's own reader."""

from pathlib import Path

import numpy as np
import pytest

from denseface.recon import NoFaceError, Settings
from denseface.service.errors import StoreError, UsageError
from denseface.service.export.mesh import triangulate
from denseface.service.export.reading import Mesh
from denseface.service.view import items as module
from denseface.service.view.items import FaceItem, FrameItem, MeshItem
from tests.unit.service.faces import small_face, small_frame

rr = pytest.importorskip("rerun", reason="needs the extra rerun")
FACE, FRAME = small_face(), small_frame()


def read(path: Path):
    """Give what a file holds: entity -> component -> values of each row, in order of frames."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            column = batch.column(name)
            if str(column.type).startswith("timestamp"):
                column = column.cast("int64")  # Python's own have no nanoseconds
            rows = column.to_pylist()
            found.setdefault(chunk.entity_path, {}).setdefault(name, []).extend(rows)
    return found


def only(components, name):
    """Give the first row of the one component whose name ends so."""
    [values] = [rows for key, rows in components.items() if key.endswith(name)]
    return np.array(values[0])


@pytest.fixture
def log(tmp_path):
    from denseface.service.view.rerun_log import to_rerun

    def to_file(*items, number=None):
        path = tmp_path / "out.rrd"
        status = to_rerun(items, number, path, viewer=False)
        assert [one.name for one in tmp_path.iterdir()] == ["out.rrd"]
        return status, read(path)

    return to_file


def test_a_face_and_its_frame_are_there_in_metres_with_their_cameras(log, capsys):
    status, found = log(FaceItem("face.npz", FACE, FRAME))
    assert status == 0
    assert "1 frame, 1 to be seen; " in capsys.readouterr().out
    dense = found["/face/dense"]
    np.testing.assert_allclose(only(dense, "Points3D:positions"), FACE.dense.points / 1000,
                               rtol=1e-6)
    np.testing.assert_allclose(only(dense, "sigma_mm"), FACE.dense.sigma)
    red = FACE.dense.colors[:, 0].astype(np.uint32)
    for place in ("dense", "mesh"):
        assert (only(found[f"/face/{place}"], "colors") >> 24 == red).all()
    mesh = found["/face/mesh"]
    np.testing.assert_array_equal(only(mesh, "triangle_indices"), triangulate(FACE.dense))
    np.testing.assert_allclose(only(mesh, "vertex_normals"), FACE.dense.normals)
    np.testing.assert_allclose(only(found["/face/measured"], "Points3D:positions"),
                               FACE.initial.points / 1000, rtol=1e-6)
    # The lightest of viridis is the largest sigma.
    sigma = only(found["/face/sigma"], "vertex_colors")
    shade = (sigma >> 24) + (sigma >> 16 & 255)
    assert shade[FACE.dense.sigma.argmax()] == shade.max()

    camera = FRAME.depth_camera
    K = only(found["/depth"], "image_from_camera").reshape(3, 3).T
    np.testing.assert_allclose(K, [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy],
                                   [0, 0, 1]])
    assert only(found["/depth"], "DepthImage:meter") == pytest.approx([1000])
    depth = only(found["/depth"], "DepthImage:buffer").astype(np.uint8).tobytes()
    assert depth == FRAME.depth.tobytes()
    assert only(found["/color"], "Image:buffer").astype(np.uint8).tobytes() == FRAME.rgb.tobytes()
    pose = FRAME.calibration.depth_to_color
    np.testing.assert_allclose(only(found["/color"], "Transform3D:translation")[0],
                               np.array(pose.translation_mm) / 1000, rtol=1e-6)
    x, y, width, height = FACE.report.face_box
    np.testing.assert_allclose(only(found["/color/face_box"], "half_sizes"),
                               [[width / 2, height / 2]])
    np.testing.assert_allclose(only(found["/color/face_box"], "centers"),
                               [[x + width / 2, y + height / 2]])
    assert "| Noise of depth | 0.50 mm |" in str(only(found["/report"], "TextDocument:text"))
    assert only(found["/figures/noise_mm"], "scalars") == pytest.approx([0.5])


def test_frames_are_on_a_timeline_and_a_face_that_is_gone_is_cleared(log, monkeypatch):
    made = iter([FACE, NoFaceError("no face found")])

    def reconstruct(frame, settings):
        one = next(made)
        if isinstance(one, Exception):
            raise one
        return one

    monkeypatch.setattr(module, "reconstruct", reconstruct)

    class Two(FrameItem):
        def each(self):
            yield self.take(0)
            yield self.take(0)._replace(number=1)

    status, found = log(Two("take", FRAME, Settings()))
    assert status == 0
    assert found["/depth"]["frame"] == [0, 1]
    assert [sorted(found["/face/mesh"]["frame"]), found["/face"]["frame"]] == [[0], [1]]
    assert found["/face"]["Clear:is_recursive"] == [[True]]
    assert "No face: no face found" in str(found["/report"])


def test_several_items_have_a_root_each_and_meshes_are_shown(log):
    mesh = Mesh(FACE.dense.points, None, FACE.dense.colors)
    status, found = log(FaceItem("a/b.npz", FACE), MeshItem("cloud of c.ply", mesh), number=0)
    assert status == 0
    assert "/b.npz/face/mesh" in found
    np.testing.assert_allclose(
        only(found[r"/cloud\ of\ c.ply/mesh"], "Points3D:positions"), mesh.points / 1000,
        rtol=1e-6)


def test_without_a_face_it_failed(log, monkeypatch):
    def refuse(frame, settings):
        raise NoFaceError("no face found")

    monkeypatch.setattr(module, "reconstruct", refuse)
    status, found = log(FrameItem("take", FRAME, Settings()))
    assert status == 1
    assert "/face/mesh" not in found


def test_a_file_is_whole_or_not_there(tmp_path):
    from denseface.service.view.rerun_log import to_rerun

    class Broken(FaceItem):
        def each(self):
            raise OSError("the disk is gone")

    (tmp_path / "out.rrd").write_text("before")
    with pytest.raises(StoreError, match=r"out\.rrd: the disk is gone"):
        to_rerun([Broken("x", FACE)], None, tmp_path / "out.rrd", viewer=False)
    assert (tmp_path / "out.rrd").read_text() == "before"
    assert len(list(tmp_path.iterdir())) == 1


def test_the_viewer_gets_a_file_that_is_gone_when_it_is_closed(tmp_path, monkeypatch):
    from denseface.service.view.rerun_log import to_rerun

    program = tmp_path / "rerun"
    program.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/asked\nfor one; do true; done\n'
                       f'cp "$one" {tmp_path}/shown.rrd\n')
    program.chmod(0o700)
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(UsageError, match="--rerun: no screen here; --save"):
        to_rerun([FaceItem("x", FACE)], None, None, viewer=True)
    monkeypatch.setenv("DISPLAY", ":0")
    assert to_rerun([FaceItem("x", FACE)], None, None, viewer=True) == 0
    *flags, file = (tmp_path / "asked").read_text().split()
    assert flags == ["--bind", "127.0.0.1", "--port", "auto"], "for nobody else"
    assert not Path(file).parent.exists()
    assert "/face/mesh" in read(tmp_path / "shown.rrd")
    program.write_text("#!/bin/sh\necho no graphics >&2; exit 3\n")
    with pytest.raises(UsageError, match="rerun's viewer failed: no graphics"):
        to_rerun([FaceItem("x", FACE)], None, None, viewer=True)
    program.unlink()
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match="there is no program `rerun`"):
        to_rerun([FaceItem("x", FACE)], None, None, viewer=True)
