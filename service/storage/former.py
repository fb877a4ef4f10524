"""What an earlier release kept, read as if this one had written it.

In version 1 the arrays of a dense cloud were sent and kept as they are in memory; all else is the
same.
"""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from denseface.recon.face import DenseCloud, Face, PointCloud
from denseface.service.errors import RemoteProtocolError
from denseface.service.protocol.messages import Result
from denseface.service.protocol.payload import FaceHeader
from denseface.service.protocol.wire import MAX_HEADER_BYTES, Buffer, Packet, decode_kept

__all__ = ["decode_former"]

_FORMER, _PRESENT = 1, 2
_ARRAYS: dict[str, tuple[str, tuple[int, ...]]] = {
    "initial_points": ("<f4", (3,)), "initial_colors": ("|u1", (3,)),
    "dense_points": ("<f4", (3,)), "dense_colors": ("|u1", (3,)), "dense_normals": ("<f4", (3,)),
    "dense_sigma": ("<f4", ()), "dense_cells": ("<i4", (2,)),
}


def decode_former(parts: Sequence[Buffer]) -> Packet:
    """Read again what this or the former version kept.

    Raises
    ------
    RemoteProtocolError
        Where it is of neither, or not as that version writes it.
    """
    header = _header(parts)
    if header is None:
        return decode_kept(parts)
    header["version"] = _PRESENT
    if header.get("kind") != "result":
        return decode_kept([json.dumps(header).encode(), *parts[1:]])
    try:
        face = FaceHeader.model_validate(header.pop("face") | {"arrays": ()})
        present, arrays = FaceHeader.of(_face(face, parts[1:]))
        return Packet(Result.model_validate(header | {"face": present}), arrays)
    except (LookupError, TypeError, ValueError) as error:
        reason = (error.errors(include_url=False)[0]["msg"]
                  if isinstance(error, ValidationError) else error)
        raise RemoteProtocolError(f"result of version {_FORMER}: {reason}") from error


def _header(parts: Sequence[Buffer]) -> dict[str, Any] | None:
    """Give the header of a message of the former version; None where it is none."""
    if not parts or len(parts[0]) > MAX_HEADER_BYTES:
        return None
    try:
        header = json.loads(bytes(parts[0]))
    except (ValueError, RecursionError):
        return None
    former = isinstance(header, dict) and header.get("version") == _FORMER
    return header if former else None


def _face(header: FaceHeader, buffers: Sequence[Buffer]) -> Face:
    counts = {"initial": header.initial_points, "dense": header.dense_points}
    of: dict[str, NDArray[Any]] = {
        name: np.frombuffer(bytes(buffer), dtype).reshape(counts[name.split("_")[0]], *each)
        for (name, (dtype, each)), buffer in zip(_ARRAYS.items(), buffers, strict=True)}
    return Face(
        PointCloud(of["initial_points"], of["initial_colors"]),
        DenseCloud(of["dense_points"], of["dense_colors"], of["dense_normals"],
                   of["dense_sigma"], of["dense_cells"], header.grid_shape, header.grid_step_mm),
        header.report)
