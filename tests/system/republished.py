"""The examples that hand faces on, and what others read of what they write."""

import base64
import importlib.util
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from tests.system.running import REPOSITORY

__all__ = ["FakeRos", "check", "example", "points_of_mcap", "points_of_rerun", "points_of_ros"]

Points = dict[str, NDArray[Any]]
"""xyz (n, 3) and sigma (n,), metres; rgb (n, 3)."""


def example(name: str) -> Callable[..., None]:
    """Give the function `main` of an example."""
    spec = importlib.util.spec_from_file_location(
        f"example_{name}", REPOSITORY / "docs" / "examples" / f"{name}.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    main: Callable[..., None] = module.main
    return main


def check(points: Points, face: Face) -> None:
    """Check that it is this face, in metres."""
    dense = face.dense
    assert np.array_equal(points["xyz"], dense.points / np.float32(1000))
    assert np.array_equal(points["rgb"], dense.colors)
    assert np.allclose(points["sigma"], dense.sigma / 1000, rtol=1e-6, atol=0)


def points_of_rerun(path: Path) -> list[Points]:
    """Read by rerun's own reader."""
    from rerun.chunk import RrdReader

    found = []
    for chunk in RrdReader(path).stream():
        if chunk.entity_path == "/dense":
            rows = chunk.to_record_batch()
            for row in range(rows.num_rows):
                xyz, rgba, sigma = (rows.column(name)[row].values for name in (
                    "Points3D:positions", "Points3D:colors", "sigma_mm"))
                colors = rgba.to_numpy().astype(">u4").view(np.uint8).reshape(-1, 4)
                found.append({"xyz": xyz.flatten().to_numpy().reshape(-1, 3),
                              "rgb": colors[:, :3], "sigma": sigma.to_numpy() / 1000})
    return found


def points_of_mcap(path: Path) -> list[Points]:
    """Read by the library of MCAP, which checks its sums; what it says of itself is so."""
    import jsonschema
    from mcap.reader import make_reader

    kinds = {7: "<f4", 1: "u1"}
    found = []
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert (schema.name, schema.encoding, channel.message_encoding) == (
                "foxglove.PointCloud", "jsonschema", "json")
            cloud = json.loads(message.data)
            jsonschema.validate(cloud, json.loads(schema.data))
            assert set(cloud) == set(json.loads(schema.data)["properties"])
            stamp = cloud["timestamp"]
            assert stamp["sec"] * 10**9 + stamp["nsec"] == message.log_time
            layout = np.dtype({
                "names": [one["name"] for one in cloud["fields"]],
                "formats": [kinds[one["type"]] for one in cloud["fields"]],
                "offsets": [one["offset"] for one in cloud["fields"]],
                "itemsize": cloud["point_stride"]})
            points = np.frombuffer(base64.b64decode(cloud["data"], validate=True), layout)
            assert (points["alpha"] == 255).all()
            found.append({
                "xyz": np.stack([points[name] for name in "xyz"], axis=1),
                "rgb": np.stack([points[name] for name in ("red", "green", "blue")], axis=1),
                "sigma": points["sigma"]})
            turn = cloud["pose"]["orientation"]
            assert np.allclose(turned(turn, (0, 0, 1)), (1, 0, 0))  # ahead is x
            assert np.allclose(turned(turn, (0, 1, 0)), (0, 0, -1))  # down is down
    return found


def turned(quaternion: dict[str, float], vector: tuple[float, float, float]) -> NDArray[Any]:
    """Turn a vector by a unit quaternion."""
    axis, w = np.array([quaternion[name] for name in "xyz"]), quaternion["w"]
    aside = 2 * np.cross(axis, vector)
    turned_by: NDArray[Any] = np.array(vector) + w * aside + np.cross(axis, aside)
    return turned_by


class _Durability(Enum):
    TRANSIENT_LOCAL = 1


@dataclass
class _Quality:
    depth: int
    durability: _Durability


@dataclass
class FakeRos:
    """As much of rclpy as the example uses; messages are those of rosbags, which knows their CDR.

    It shows that the example's own calls fit together, not that they fit the real rclpy.
    """

    published: list[Any] = field(default_factory=list)
    topics: list[tuple[str, int, _Durability]] = field(default_factory=list)
    log: list[str] = field(default_factory=list)
    state: str = "new"

    def modules(self) -> dict[str, Any]:
        """Give what `import` finds, by its name."""
        types = _types().types
        rclpy = ModuleType("rclpy")
        vars(rclpy).update(
            init=lambda: setattr(self, "state", "running"), create_node=lambda _: self,
            try_shutdown=lambda: setattr(self, "state", "down"))
        return {
            "rclpy": rclpy,
            "rclpy.qos": SimpleNamespace(DurabilityPolicy=_Durability, QoSProfile=_Quality),
            "sensor_msgs": ModuleType("sensor_msgs"),
            "sensor_msgs.msg": SimpleNamespace(
                PointCloud2=types["sensor_msgs/msg/PointCloud2"],
                PointField=types["sensor_msgs/msg/PointField"]),
            "std_msgs": ModuleType("std_msgs"),
            "std_msgs.msg": SimpleNamespace(Header=types["std_msgs/msg/Header"])}

    def create_publisher(self, kind: Any, topic: str, quality: _Quality) -> "FakeRos":
        assert kind.__msgtype__ == "sensor_msgs/msg/PointCloud2"
        self.topics.append((topic, quality.depth, quality.durability))
        return self

    def publish(self, message: Any) -> None:
        assert self.state == "running"
        self.published.append(message)

    def get_clock(self) -> Any:
        stamp = _types().types["builtin_interfaces/msg/Time"](sec=5, nanosec=7)
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: stamp))

    def get_logger(self) -> Any:
        return SimpleNamespace(info=self.log.append)

    def destroy_node(self) -> None:
        self.state = "destroyed"


def _types() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def points_of_ros(message: Any) -> Points:
    """Read what rosbags makes of a message: written as CDR and read again."""
    store = _types()
    assert message.data.typecode == "B"  # what rclpy takes without looking at each byte
    message.data = np.frombuffer(message.data, np.uint8)
    read = store.deserialize_cdr(
        store.serialize_cdr(message, message.__msgtype__), message.__msgtype__)
    assert (read.header.stamp.sec, read.header.frame_id) == (5, "denseface_optical")
    assert (read.height, read.is_bigendian, read.is_dense) == (1, False, True)
    assert read.row_step == read.width * read.point_step == len(read.data)
    assert {(one.datatype, one.count) for one in read.fields} == {(7, 1)}  # FLOAT32
    layout = np.dtype({
        "names": [one.name for one in read.fields], "formats": ["<f4"] * len(read.fields),
        "offsets": [one.offset for one in read.fields], "itemsize": read.point_step})
    points = read.data.view(layout)
    packed = np.ascontiguousarray(points["rgb"]).view(np.uint32)
    normals = np.stack([points[f"normal_{axis}"] for axis in "xyz"])
    assert np.allclose(np.linalg.norm(normals, axis=0), 1, atol=1e-5)
    return {"xyz": np.stack([points[axis] for axis in "xyz"], axis=1),
            "rgb": np.stack([packed >> 16 & 255, packed >> 8 & 255, packed & 255], axis=1),
            "sigma": points["sigma"]}
