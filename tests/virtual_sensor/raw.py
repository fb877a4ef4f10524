"""A process that sees the virtual sensor through the bare `primesense` binding, and can be asked.

As a program it reads one Python expression or statement a line, in a namespace with `openni2`, the
binding; `device`, once `open` was called; and the functions below; and answers with a line of JSON.
"""

import json
import runpy
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tests.nursery import Forked
from tests.waiting import LIMIT_S

__all__ = ["Raw"]

_ROOT = Path(__file__).resolve().parents[2]


class Raw:
    """The process, from the test's side.

    Parameters
    ----------
    env : see `environment`
    """

    def __init__(self, env: dict[str, str]) -> None:
        self.process = Forked(
            ["-m", "tests.virtual_sensor.raw"], cwd=_ROOT, env=env | {"PYTHONPATH": str(_ROOT)},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.close()

    def ask(self, code: str) -> Any:
        """Have an expression evaluated, or a statement executed.

        Raises
        ------
        RuntimeError
            What it raised, or the process ended or hangs.
        """
        self.tell(code)
        return self.answer()

    def image(self) -> NDArray[Any]:
        """Give the pixels of the frame that was read last."""
        with tempfile.TemporaryDirectory() as folder:
            self.ask(f"np.save('{folder}/image.npy', image)")
            pixels: NDArray[Any] = np.load(f"{folder}/image.npy")
            return pixels

    def tell(self, code: str) -> None:
        """Have something done, without waiting for it."""
        assert self.process.stdin is not None
        self.process.stdin.write(code.replace("\n", "\r") + "\n")
        self.process.stdin.flush()

    def answer(self) -> Any:
        """Give the answer to what was told."""
        assert self.process.stdout is not None
        timer = threading.Timer(LIMIT_S, self.process.kill)
        timer.start()
        line = self.process.stdout.readline()
        timer.cancel()
        if not line:
            raise RuntimeError("the process ended or was stopped because it hung")
        said = json.loads(line)
        if "error" in said:
            raise RuntimeError(said["error"])
        return said["value"]


def _serve() -> None:
    import os

    # The binding as denseface mends it, and nothing else of denseface.
    binding = runpy.run_path(str(_ROOT / "capture" / "openni2" / "_binding.py"))
    c_api, openni2 = binding["c_api"], binding["openni2"]

    from tests.virtual_sensor.marks import read_mark

    folder = Path(os.environ["OPENNI2_REDIST"])
    c_api.load_dll(str(folder / "libOpenNI2.so"))
    c_api.oniSetLogFileOutput(False)
    c_api.oniSetLogConsoleOutput(False)
    openni2.loaded_dll_directory = str(folder)
    openni2.initialize()
    events: list[list[Any]] = []
    """Connected, disconnected and state events, each with the URI."""

    class Listener(openni2.DeviceListener):  # type: ignore[misc, name-defined]
        def _on_connected(self, info: Any, _: Any) -> None:
            events.append(["connected", info[0].uri.decode()])

        def _on_disconnected(self, info: Any, _: Any) -> None:
            events.append(["disconnected", info[0].uri.decode()])

        def _on_state_changed(self, info: Any, state: Any, _: Any) -> None:
            events.append(["state", info[0].uri.decode(), int(state)])

    names: dict[str, Any] = {}

    def uris() -> list[str]:
        return [uri.decode() for uri in openni2.Device.enumerate_uris()]

    def open_device(uri: str | None = None) -> None:
        device = openni2.Device.__new__(openni2.Device)
        try:
            device.__init__(None if uri is None else uri.encode())
        except BaseException:
            # Closing what was not opened makes the library count to -1, and the next opening crash.
            device._handle = None
            raise
        names["device"] = device

    def create(*kinds: str) -> None:
        for kind in kinds or ("depth", "color"):
            names[kind] = getattr(names["device"], f"create_{kind}_stream")()

    def start(*kinds: str) -> None:
        for kind in kinds or ("depth", "color"):
            if kind not in names:
                create(kind)
            names[kind].start()

    def stop(*kinds: str) -> None:
        for kind in kinds or ("depth", "color"):
            names[kind].stop()

    def modes(kind: int) -> list[list[Any]]:
        info = names["device"].get_sensor_info(kind)
        return [[m.resolutionX, m.resolutionY, m.fps, int(m.pixelFormat)] for m in info.videoModes]

    def read(kind: str, timeout_s: float = LIMIT_S) -> dict[str, Any] | None:
        """Give the next frame of a stream: what the library says of it; its pixels in `image`."""
        if openni2.wait_for_any_stream([names[kind]], timeout_s) is None:
            return None
        frame = names[kind].read_frame()
        data = np.frombuffer(bytes(frame.get_buffer_as_uint8()), np.uint8)
        names["image"] = _shaped(data, frame)
        said = {name: int(getattr(frame, name)) for name in (
            "timestamp", "frameIndex", "width", "height", "dataSize", "stride", "croppingEnabled",
            "cropOriginX", "cropOriginY")}
        with suppress(ValueError):
            said |= read_mark(names["image"])._asdict()
        frame.close()
        return said

    def _shaped(data: Any, frame: Any) -> Any:
        rows = data.reshape(frame.height, frame.stride)
        channels = frame.stride // frame.width
        if channels == 3:
            return rows.reshape(frame.height, frame.width, 3)
        return rows.view(np.uint16)

    names |= {"openni2": openni2, "np": np, "events": events, "uris": uris, "open": open_device,
              "create": create, "start": start, "stop": stop, "modes": modes, "read": read}
    names["listener"] = Listener()
    for line in sys.stdin:
        code = line.rstrip("\n").replace("\r", "\n")
        try:
            try:
                value = eval(code, names)  # noqa: S307
            except SyntaxError:
                exec(code, names)  # noqa: S102
                value = None
            said = {"value": value}
        except Exception as error:
            said = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(said, default=float), flush=True)


if __name__ == "__main__":
    _serve()
