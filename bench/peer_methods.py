"""What others use to turn the same seeds into a dense surface.

Each function takes a `Case` and gives (m, 3) points, mm, one for each query; NaN where the method
gives none. Time is taken around the whole call.
"""

from typing import Any, Literal

import cv2
import numpy as np
import open3d as o3d
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator, griddata

from bench.cases import Case

__all__ = ["griddata_points", "inpaint_points", "poisson_points", "rbf_points"]

Points = NDArray[np.float64]

_AROUND_PX = 8
_INPAINT_RADIUS_PX = 3.0
_POISSON_NORMALS = 6.0
_RBF_R0 = 8.0
_BEFORE_MM = 1000.0


def inpaint_points(case: Case, sigma: float) -> Points:
    """OpenCV: depth crop inpainted (Telea), blurred by a Gaussian, upsampled bicubically.

    The result is sampled at the pixels where the depth camera sees our dense points, so that both
    have as many points in the same directions.
    """
    low = case.seed_pixels.min(axis=0) - _AROUND_PX
    shape = case.seed_pixels.max(axis=0) + _AROUND_PX + 1 - low
    crop = np.zeros(shape, np.float32)
    missing = np.ones(shape, np.uint8)
    rows, columns = (case.seed_pixels - low).T
    crop[rows, columns] = case.seeds[:, 2]
    missing[rows, columns] = 0
    filled = cv2.inpaint(crop, missing, _INPAINT_RADIUS_PX, cv2.INPAINT_TELEA)
    smooth = cv2.GaussianBlur(filled, (0, 0), sigma) if sigma > 0 else filled
    u, v = (case.pixels - low[::-1]).astype(np.float32).T
    # OpenCV's maps have at most 32767 rows: the queries are laid out as an image.
    side = int(np.ceil(np.sqrt(len(u))))
    maps = np.zeros((2, side * side), np.float32)
    maps[0, :len(u)], maps[1, :len(u)] = u, v
    z = cv2.remap(smooth, maps[0].reshape(side, side), maps[1].reshape(side, side),
                  cv2.INTER_CUBIC).ravel()[:len(u)].astype(np.float64)
    along = case.face.dense.points
    return np.asarray(along * (z / along[:, 2])[:, None], np.float64)


def rbf_points(case: Case, neighbors: int) -> Points:
    """SciPy: `RBFInterpolator` on the nearest seeds of each query.

    Gaussian with R0 = 8 spacings, linear tail, smoothing 1: of Gaussians, cubics, thin plates
    and cones with smoothing 0.3 to 3000 none was better on three recordings by over 0.01 mm.
    """
    fit = RBFInterpolator(
        case.seeds[:, :2], case.seeds[:, 2], neighbors=neighbors, kernel="gaussian",
        epsilon=1 / (_RBF_R0 * case.spacing), degree=1, smoothing=1.0)
    return case.at(np.asarray(fit(case.queries), np.float64))


def griddata_points(case: Case, method: Literal["linear", "cubic"]) -> Points:
    """SciPy: `griddata` over the seeds' Delaunay triangles."""
    return case.at(griddata(case.seeds[:, :2], case.seeds[:, 2], case.queries, method=method))


def poisson_points(case: Case, depth: int) -> Points:
    """Open3D: screened Poisson; its mesh is met by rays along z at the queries."""
    geometry: Any = o3d.geometry
    cloud = geometry.PointCloud(o3d.utility.Vector3dVector(case.seeds))
    cloud.estimate_normals(geometry.KDTreeSearchParamHybrid(
        radius=_POISSON_NORMALS * case.spacing, max_nn=50))
    cloud.orient_normals_towards_camera_location(np.zeros(3))
    mesh, _ = geometry.TriangleMesh.create_from_point_cloud_poisson(
        cloud, depth=depth, n_threads=1)
    scene: Any = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(np.asarray(mesh.vertices, np.float32),
                        np.asarray(mesh.triangles, np.uint32))
    rays = np.zeros((len(case.queries), 6), np.float32)
    rays[:, :2] = case.queries
    rays[:, 2] = start = case.seeds[:, 2].min() - _BEFORE_MM
    rays[:, 5] = 1
    make: Any = o3d.core.Tensor
    z = start + scene.cast_rays(make(rays), nthreads=1)["t_hit"].numpy().astype(np.float64)
    return case.at(np.where(np.isfinite(z), z, np.nan))
