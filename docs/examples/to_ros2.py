"""Publish every face to ROS 2 as a sensor_msgs/PointCloud2 on the topic `face`.

    source /opt/ros/jazzy/setup.bash
    python to_ros2.py                  # until Ctrl-C; RViz: fixed frame "denseface_optical"
    python to_ros2.py 5                # the last five faces

The hub is that of DENSEFACE_ADDRESS, with the keys of DENSEFACE_KEY and DENSEFACE_HUB_KEY.
"""

import array
import sys
from contextlib import suppress
from itertools import islice
from typing import Any

import numpy as np
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from denseface import Client, Face

POINT = np.dtype([(name, "<f4") for name in (
    "x", "y", "z", "rgb", "normal_x", "normal_y", "normal_z", "sigma")])


def cloud(face: Face, stamp: Any) -> PointCloud2:
    """Give the dense cloud in metres, in an optical frame (REP 103): x right, y down, z forward."""
    dense, points = face.dense, np.zeros(len(face.dense), POINT)
    points["x"], points["y"], points["z"] = dense.points.T / 1000
    points["normal_x"], points["normal_y"], points["normal_z"] = dense.normals.T
    points["sigma"] = dense.sigma / 1000
    red, green, blue = dense.colors.T.astype(np.uint32)
    points["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)  # as PCL and RViz have it
    return PointCloud2(
        header=Header(stamp=stamp, frame_id="denseface_optical"), height=1, width=len(points),
        fields=[PointField(name=name, offset=offset, datatype=PointField.FLOAT32, count=1)
                for name, (_, offset) in POINT.fields.items()],
        is_bigendian=False, point_step=POINT.itemsize, row_step=POINT.itemsize * len(points),
        data=array.array("B", points.tobytes()), is_dense=True)


def main(last: str | None = None) -> None:
    """Follow the faces, for ever or for so many."""
    count = None if last is None else int(last)
    rclpy.init()
    node = rclpy.create_node("denseface")
    # Whoever comes later gets the last face, too.
    quality = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(PointCloud2, "face", quality)
    with suppress(KeyboardInterrupt), Client() as client:
        for face in islice(client.faces(last=count), count):
            publisher.publish(cloud(face, node.get_clock().now().to_msg()))
            node.get_logger().info(f"{face.report.capture_id}: {len(face.dense)} points")
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:])
