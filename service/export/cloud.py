"""Dense clouds as `.ply` and `.pcd`: binary, mm, camera frame.

x y z, normal (float), red green blue (uchar; in `.pcd` packed into one number as PCL does), sigma
(float). Comments say where the face comes from.
"""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import DenseCloud, Face
from denseface.service.export.provenance import comments

__all__ = ["to_pcd", "to_ply"]

_PLY_TYPES = {"<f4": "float", "|u1": "uchar"}
_XYZ_AND_NORMAL = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"),
                   ("nx", "<f4"), ("ny", "<f4"), ("nz", "<f4")]


def to_ply(face: Face) -> bytes:
    """Give the bytes of a `.ply` file."""
    cloud = face.dense
    fields = [*_XYZ_AND_NORMAL, ("red", "|u1"), ("green", "|u1"), ("blue", "|u1"),
              ("sigma", "<f4")]
    table = _table(cloud, fields)
    for name, channel in zip(("red", "green", "blue"), cloud.colors.T, strict=True):
        table[name] = channel
    properties = "".join(f"property {_PLY_TYPES[kind]} {name}\n" for name, kind in fields)
    told = "".join(f"comment {line}\n" for line in comments(face.report))
    header = (f"ply\nformat binary_little_endian 1.0\ncomment by denseface, mm\n{told}"
              f"element vertex {len(cloud)}\n{properties}end_header\n")
    return header.encode() + table.tobytes()


def to_pcd(face: Face) -> bytes:
    """Give the bytes of a `.pcd` file, version 0.7."""
    cloud = face.dense
    table = _table(cloud, [*_XYZ_AND_NORMAL, ("rgb", "<u4"), ("sigma", "<f4")])
    table["rgb"] = cloud.colors.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    told = "".join(f"# {line}\n" for line in comments(face.report))
    header = (f"# .PCD v0.7 - Point Cloud Data file format\n{told}VERSION 0.7\n"
              "FIELDS x y z normal_x normal_y normal_z rgb sigma\nSIZE 4 4 4 4 4 4 4 4\n"
              "TYPE F F F F F F U F\nCOUNT 1 1 1 1 1 1 1 1\n"
              f"WIDTH {len(cloud)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(cloud)}\n"
              "DATA binary\n")
    return header.encode() + table.tobytes()


def _table(cloud: DenseCloud, fields: list[tuple[str, str]]) -> NDArray[np.void]:
    """Give a row for each point, filled but for its colour."""
    table = np.zeros(len(cloud), fields)
    for name, column in zip(("x", "y", "z", "nx", "ny", "nz"),
                            (*cloud.points.T, *cloud.normals.T), strict=True):
        table[name] = column
    table["sigma"] = cloud.sigma
    return table
