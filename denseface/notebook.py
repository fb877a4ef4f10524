"""Faces as other libraries have them: figures, meshes, clouds. `Face.plot` and the like call this.

Each library is imported where it is asked for, and is none that the rest needs.
"""

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from denseface.missing import explained
from denseface.recon.face import DenseCloud, Face, PointCloud
from denseface.service.export.mesh import triangulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from trimesh import Trimesh

__all__ = ["plot", "to_open3d_cloud", "to_open3d_mesh", "to_trimesh"]

_INCHES = 12.0, 4.6
"""Width and height of a figure."""
_SHOWN_SIGMA = 98
"""Percentile of `sigma` at which its colours end: single points at the rim have far more."""


def plot(face: Face) -> "Figure":
    """Draw colours, depth and sigma side by side; see `Face.plot`."""
    with explained():
        from matplotlib.figure import Figure

    class Shown(Figure):
        """Shows itself in a notebook, also where nobody asked for matplotlib's own way."""

        def _repr_png_(self) -> bytes:
            file = io.BytesIO()
            self.savefig(file, format="png")
            return file.getvalue()

    dense = face.dense
    figure = Shown(figsize=_INCHES, layout="constrained")
    parts = figure.subplots(1, 3, sharex=True, sharey=True)
    place = _place(dense)
    colors = np.zeros((*dense.grid_shape, 4), np.uint8)
    colors[dense.cells[:, 0], dense.cells[:, 1], :3] = dense.colors
    colors[dense.cells[:, 0], dense.cells[:, 1], 3] = 255
    parts[0].imshow(colors, extent=place, interpolation="nearest")
    parts[0].set(title=f"{len(dense):,} points", xlabel="x, mm", ylabel="y, mm")
    limit = float(np.percentile(dense.sigma, _SHOWN_SIGMA)) if len(dense) else 1.0
    for part, values, name, colormap, most in (
            (parts[1], dense.points[:, 2], "depth, mm", "viridis_r", None),
            (parts[2], dense.sigma, "sigma, mm", "magma", limit)):
        drawn = part.imshow(_image(dense, values), extent=place, cmap=colormap, vmax=most,
                            interpolation="nearest")
        figure.colorbar(drawn, ax=part, shrink=0.85)
        part.set(title=name, xlabel="x, mm")
    if face.report.capture_id or face.report.source:
        figure.suptitle(_plain(face.report.capture_id or face.report.source))
    return figure


def to_open3d_cloud(cloud: PointCloud) -> Any:
    """Give an Open3D point cloud; see `PointCloud.to_open3d`."""
    with explained():
        import open3d

    made = open3d.geometry.PointCloud()
    made.points = _vectors(open3d, cloud.points)
    made.colors = _vectors(open3d, cloud.colors / 255)
    if isinstance(cloud, DenseCloud):
        made.normals = _vectors(open3d, cloud.normals)
    return made


def to_open3d_mesh(face: Face) -> Any:
    """Give an Open3D mesh; see `Face.to_open3d`."""
    with explained():
        import open3d

    dense = face.dense
    made = open3d.geometry.TriangleMesh(
        _vectors(open3d, dense.points), open3d.utility.Vector3iVector(triangulate(dense)))
    made.vertex_colors = _vectors(open3d, dense.colors / 255)
    made.vertex_normals = _vectors(open3d, dense.normals)
    return made


def to_trimesh(face: Face) -> "Trimesh":
    """Give a mesh of trimesh; see `Face.to_trimesh`."""
    with explained():
        from trimesh import Trimesh

    dense = face.dense
    # Unprocessed: vertices stay as many, and in the order, of the points.
    return Trimesh(dense.points, triangulate(dense), vertex_normals=dense.normals,
                   vertex_colors=dense.colors, process=False)


def _vectors(open3d: Any, rows: NDArray[Any]) -> Any:
    return open3d.utility.Vector3dVector(np.ascontiguousarray(rows, np.float64))


def _image(dense: DenseCloud, values: NDArray[np.float32]) -> NDArray[np.float32]:
    image = np.full(dense.grid_shape, np.nan, np.float32)
    image[dense.cells[:, 0], dense.cells[:, 1]] = values
    return image


def _place(dense: DenseCloud) -> tuple[float, float, float, float]:
    """Give where the grid's image lies: left, right, bottom and top, mm; y points down."""
    rows, columns = dense.grid_shape
    step = dense.grid_step_mm
    if not len(dense):
        return (0.0, columns * step, rows * step, 0.0)
    left, top = dense.points[0, :2] - (dense.cells[0, ::-1] + 0.5) * step
    return (float(left), float(left + columns * step), float(top + rows * step), float(top))


def _plain(text: str) -> str:
    """Give a text in which matplotlib finds no formula."""
    return text.replace("$", r"\$")
