"""What a notebook shows, and faces as other libraries have them."""

import base64
import re
import sys
from dataclasses import replace
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest

from denseface import DenseCloud, MissingPackageError, PointCloud
from denseface.html_repr import PICTURE_SIDE
from tests.unit.denseface.test_reprs import face, frame
from tests.unit.service.faces import small_face

HOSTILE = '"><script>alert(1)</script><img src=x onerror=y>'


class Page(HTMLParser):
    """The elements, the text, and that each is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.sources: list[str] = []
        self.text = ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag == "img":
            self.sources.append(dict(attributes)["src"])
        else:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += f"{data}|"


def shown(thing):
    return Page(thing._repr_html_())


def pictures(page):
    """As OpenCV reads them, RGBA or RGB."""
    for source in page.sources:
        data = base64.b64decode(source.removeprefix("data:image/png;base64,"), validate=True)
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        yield cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA if image.shape[2] == 4 else
                           cv2.COLOR_BGR2RGB)


def test_a_face_shows_counts_sigma_and_what_is_odd():
    page = shown(face())
    for told in ("Face a1|", "dense points|102|", "16 x 22 x 2 mm|", "1.31 mm (median)",
                 "sensor|S123|", "warning|odd|"):
        assert told in page.text
    colors, relief = pictures(page)
    assert colors.shape == relief.shape == (12, 9, 4)


def test_each_point_of_a_grid_is_a_pixel_and_gaps_are_transparent():
    dense = small_face().dense
    colors, relief = pictures(shown(dense))
    rows, columns = dense.cells.T
    assert (colors[rows, columns, :3] == dense.colors).all()
    assert (colors[..., 3] > 0).sum() == len(dense)
    assert len(np.unique(relief[rows, columns, 0])) > 10
    assert (relief[..., 0] == relief[..., 2]).all()


@pytest.mark.parametrize("scale", [1, 40])
def test_pictures_are_small_however_many_points_there_are(scale):
    cells = np.argwhere(np.ones((12 * scale, 9 * scale), np.bool_)).astype(np.int32)
    n = len(cells)
    points = np.column_stack([cells[:, ::-1], np.full(n, 700)]).astype(np.float32)
    cloud = DenseCloud(
        points, np.full((n, 3), 90, np.uint8), np.tile(np.float32([0, 0, -1]), (n, 1)),
        np.ones(n, np.float32), cells, (12 * scale, 9 * scale), 1.0)
    for thing in (cloud, PointCloud(points, cloud.colors)):
        for image in pictures(shown(thing)):
            assert max(image.shape) <= PICTURE_SIDE
            assert (image[..., 3] == 255).mean() > 0.9
            assert len(np.unique(image[image[..., 3] > 0, 0])) == 1


def test_a_frame_shows_both_images():
    made = frame()
    page = shown(made)
    assert "depth|8 x 6|" in page.text
    depth, color = pictures(page)
    assert (color == made.color).all()
    assert ((depth[..., 3] == 0) == (made.depth == 0)).all()
    nearest, farthest = (np.unravel_index(found, made.depth.shape) for found in (
        np.where(made.depth > 0, made.depth, 2**15).argmin(), made.depth.argmax()))
    assert depth[nearest][0] > depth[farthest][0]
    bare = shown(replace(made, color=None, color_timestamp_us=made.depth_timestamp_us))
    assert "color|none|" in bare.text
    assert len(bare.sources) == 1


@pytest.mark.parametrize("thing", [face(HOSTILE, HOSTILE), frame(HOSTILE)],
                         ids=lambda one: type(one).__name__)
def test_what_comes_from_outside_is_text(thing):
    page = shown(thing)
    assert {*page.tags} == {"div", "img", "strong", "table", "tr", "td"}
    assert HOSTILE in page.text
    assert not re.search(r'(?:src|href)="(?!data:image/png)', thing._repr_html_())


def test_nothing_to_see_is_shown_too():
    empty = PointCloud(np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8))
    assert "points|0|" in shown(empty).text
    no_depth = replace(frame(), depth=np.zeros((6, 8), np.uint16))
    assert "of it measured|0%|" in shown(no_depth).text


def test_a_figure_has_each_point_at_its_place_in_mm():
    made = face()
    figure = made.plot()
    colors, depth, sigma = (part.images[0] for part in figure.axes[:3])
    dense = made.dense
    left, right, bottom, top = colors.get_extent()
    rows, columns = dense.cells.T
    height, width = dense.grid_shape
    assert np.allclose(left + (columns + 0.5) * (right - left) / width, dense.points[:, 0])
    assert np.allclose(top + (rows + 0.5) * (bottom - top) / height, dense.points[:, 1])
    assert figure.axes[0].yaxis_inverted()
    assert (colors.get_array()[rows, columns, :3] == dense.colors).all()
    assert np.allclose(depth.get_array()[rows, columns], dense.points[:, 2])
    assert np.allclose(sigma.get_array()[rows, columns], dense.sigma)
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_trimesh_has_the_points_and_a_front_toward_the_camera():
    made = face()
    mesh = made.to_trimesh()
    assert np.allclose(mesh.vertices, made.dense.points)
    assert (mesh.visual.vertex_colors[:, :3] == made.dense.colors).all()
    assert np.allclose(mesh.vertex_normals, made.dense.normals, atol=1e-6)
    assert (mesh.face_normals[:, 2] < 0).all()
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1


def test_open3d_has_the_same_as_a_mesh_and_as_clouds():
    made = face()
    mesh, cloud, initial = made.to_open3d(), made.dense.to_open3d(), made.initial.to_open3d()
    for thing, points in ((mesh.vertices, made.dense.points), (cloud.points, made.dense.points),
                          (initial.points, made.initial.points)):
        assert np.allclose(np.asarray(thing), points)
    assert (np.asarray(mesh.triangles) == made.to_trimesh().faces).all()
    for thing in (mesh.vertex_colors, cloud.colors):
        assert (np.rint(np.asarray(thing) * 255) == made.dense.colors).all()
    assert np.allclose(np.asarray(mesh.vertex_normals), made.dense.normals)
    assert not initial.has_normals()


@pytest.mark.parametrize(("call", "missing", "extra"), [
    ("plot", "matplotlib", "notebook"), ("to_trimesh", "trimesh", "notebook"),
    ("to_open3d", "open3d", "open3d")])
def test_a_library_that_is_not_there_is_named_with_its_extra(monkeypatch, call, missing, extra):
    for name in (missing, f"{missing}.figure"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingPackageError, match=rf"{missing} .*'denseface-core\[{extra}\]'"):
        getattr(face(), call)()
