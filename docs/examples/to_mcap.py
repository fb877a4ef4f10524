"""Write every face to an MCAP file, as the `foxglove.PointCloud` that Foxglove shows in 3D.

    pip install mcap
    python to_mcap.py faces.mcap       # until Ctrl-C
    python to_mcap.py faces.mcap 5     # the last five faces

The hub is that of DENSEFACE_ADDRESS, with the keys of DENSEFACE_KEY and DENSEFACE_HUB_KEY.
"""

import base64
import json
import sys
import time
from contextlib import suppress
from itertools import islice
from typing import Any

import numpy as np
from mcap.writer import Writer

from denseface import Client, Face

POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("sigma", "<f4"),
                  ("red", "u1"), ("green", "u1"), ("blue", "u1"), ("alpha", "u1")])
NUMERIC_TYPE = {"<f4": 7, "|u1": 1}  # foxglove.NumericType
INTEGER, NUMBER, STRING = {"type": "integer"}, {"type": "number"}, {"type": "string"}


def record(**properties: Any) -> dict[str, Any]:
    """Give the JSON schema of an object."""
    return {"type": "object", "properties": properties}


SCHEMA = {"title": "foxglove.PointCloud"} | record(
    timestamp={"title": "time"} | record(sec=INTEGER, nsec=INTEGER), frame_id=STRING,
    pose=record(position=record(x=NUMBER, y=NUMBER, z=NUMBER),
                orientation=record(x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)),
    point_stride=INTEGER,
    fields={"type": "array", "items": record(name=STRING, offset=INTEGER, type=INTEGER)},
    data=STRING | {"contentEncoding": "base64"})


def cloud(face: Face, at_ns: int) -> dict[str, Any]:
    """Give the dense cloud in metres; the pose turns the camera's axes so that z is up."""
    points, dense = np.zeros(len(face.dense), POINT), face.dense
    points["x"], points["y"], points["z"] = dense.points.T / 1000
    points["red"], points["green"], points["blue"] = dense.colors.T
    points["sigma"], points["alpha"] = dense.sigma / 1000, 255
    return {
        "timestamp": {"sec": at_ns // 10**9, "nsec": at_ns % 10**9}, "frame_id": "denseface",
        "pose": {"position": {"x": 0, "y": 0, "z": 0},
                 "orientation": {"x": -0.5, "y": 0.5, "z": -0.5, "w": 0.5}},
        "point_stride": POINT.itemsize,
        "fields": [{"name": name, "offset": offset, "type": NUMERIC_TYPE[kind.str]}
                   for name, (kind, offset) in POINT.fields.items()],
        "data": base64.b64encode(points.tobytes()).decode()}


def main(path: str, last: str | None = None) -> None:
    """Follow the faces, for ever or for so many."""
    count = None if last is None else int(last)
    writer = Writer(path)
    writer.start()
    schema = writer.register_schema(
        "foxglove.PointCloud", "jsonschema", json.dumps(SCHEMA).encode())
    channel = writer.register_channel("face", "json", schema)
    try:
        with suppress(KeyboardInterrupt), Client() as client:
            for number, face in enumerate(islice(client.faces(last=count), count)):
                now = time.time_ns()
                writer.add_message(channel, now, json.dumps(cloud(face, now)).encode(), now, number)
                print(f"{face.report.capture_id}: {len(face.dense)} points")
    finally:
        writer.finish()


if __name__ == "__main__":
    main(*sys.argv[1:])
