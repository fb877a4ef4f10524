"""`denseface up` with its page for visitors, on a virtual sensor that a test steers."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.request import urlopen

import psutil

from denseface.capture import open_source
from denseface.service.client import Client
from denseface.service.protocol.messages import Status
from tests.simulator import KINECT_DEFAULT
from tests.system.running import RECORDINGS, Service, service, stopping
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control
from tests.virtual_sensor.process import environment
from tests.waiting import LIMIT_S, until

__all__ = ["Served", "serving", "somebody"]

_URL = re.compile(r"the page for visitors.*?(http://127\.0\.0\.1:\d+)")


@dataclass
class Served:
    """A running kiosk."""

    up: Service
    control: Control
    url: str

    @property
    def data(self) -> Path:
        """The hub's folder."""
        return self.up.data

    def client(self) -> Client:
        """Open a client of the hub."""
        return self.up.client()

    def status(self) -> Status:
        """Ask the hub."""
        return self.up.status()

    def process(self, command: str) -> psutil.Process:
        """Give the process of `denseface COMMAND` under this service."""
        def found() -> psutil.Process | None:
            for one in self.up.family():
                try:
                    line = one.cmdline()
                except psutil.Error:
                    continue
                if command in line:
                    return one
            return None

        process = until(found)
        assert process
        return process

    def pressed(self) -> list[str]:
        """Give the ids of all captures whose frame is safe, so far."""
        return re.findall(r"accepted +capture_id=(\w+)", self.up.log.read_text())

    def previews(self) -> float:
        """Give how many pictures were asked of the sensor so far.

        Figures are those of the hub's last heartbeat, so one that comes after this call is waited
        for: it has another number of the sensor's frames. By the second, what was under way came.
        """
        *_, url = re.findall(r"http://\S+/metrics", self.up.log.read_text())

        def figure(name: str) -> float:
            with urlopen(url, timeout=LIMIT_S) as answer:  # noqa: S310 - this machine
                text = answer.read().decode()
            counted = re.findall(rf"^denseface_{name}_total\S* (\S+)$", text, re.MULTILINE)
            return sum(map(float, counted))

        for _ in range(2):
            frames = figure("sensor_frames")
            until(lambda before=frames: figure("sensor_frames") != before)
        return figure("previews")

    def holds(self, capture_id: str) -> bool:
        """Say whether a file of the data folder has a capture's id in its name or its bytes."""
        sought = capture_id.encode()
        for path in self.data.rglob("*"):
            try:
                if capture_id in path.name or (path.is_file() and sought in path.read_bytes()):
                    return True
            except FileNotFoundError:  # removed meanwhile
                continue
        return False


def somebody(path: Path) -> Path:
    """Write a clip of somebody who stands still and looks at the camera."""
    with open_source(RECORDINGS / "frontal_700.oni") as source:
        images = [(frame.depth.copy(), frame.rgb.copy()) for frame in source]
    write_clip(path, images, calibration=KINECT_DEFAULT.calibration)
    return path


@contextmanager
def serving(
    folder: Path, *arguments: str, marks: bool = False, **variables: str
) -> Iterator[Served]:
    """Run the service with its page until the sensor streams and there is a worker.

    marks : whether pictures say when they were exposed
    """
    with Control(folder / "sensor", somebody(folder / "clip"), marks=marks) as control, service(
            "openni2:", folder / "data", "--kiosk-address", "127.0.0.1:0", "--kiosk-folder",
            str(folder / "kiosk"), *arguments,
            environment={**environment(controls=[control]), **stopping(folder / "data"),
                         "DENSEFACE_KIOSK": "on"} | variables,
    ) as up:
        url = until(lambda: _URL.search(up.log.read_text()))
        yield Served(up, control, url[1] if url else "")
