"""compose.yaml, service by service."""

import re
from contextlib import ExitStack
from pathlib import Path

import yaml

from tests.container.box import SENSOR, Box, Image, volumes
from tests.container.visit import visit
from tests.ports import free_port
from tests.waiting import until

__all__ = ["composes"]

_FILE = Path(__file__).resolve().parents[2] / "compose.yaml"


def composes(image: Image) -> list[tuple[str, str]]:
    """The services of compose.yaml, with their commands, volumes, users and health checks."""
    services = yaml.safe_load(_FILE.read_text())["services"]
    services["worker-2"] = services["worker"]
    rows = []
    with ExitStack() as stack:
        shared: dict[str, Path] = {}
        boxes: dict[str, Box] = {}
        port = free_port()
        for name, service in services.items():
            mine = {}
            for one in service["volumes"]:
                source, there = one.split(":")[:2]
                if source.startswith("/"):
                    continue
                if source not in shared:
                    shared |= volumes(stack, source)
                mine[there] = shared[source]
            mine |= volumes(stack, *({"/data", "/faces"} - mine.keys()))
            command = [_filled(one) for one in service["command"]]
            command = [SENSOR if one == "openni2:" else one for one in command]
            variables = {key: _filled(value).replace("8080", str(port))
                         for key, value in service["environment"].items()}
            boxes[name] = box = Box(image, command, user=_filled(service["user"]), volumes=mine,
                                    environment=variables,
                                    network=service.get("network_mode") != "none")
            stack.callback(box.end)
            if name == "hub":
                until(lambda: boxes["hub"].healthy(services["hub"]["healthcheck"]["test"][1:]))
        for name, box in boxes.items():
            test = services[name]["healthcheck"]["test"][1:]
            until(lambda box=box, test=test: box.healthy(test))
        hub = boxes["hub"]
        hub.say("denseface", "status", "--wait", "120")
        hub.say("denseface", "press", "--save", "/faces/face.ply")
        assert (shared["faces"] / "face.ply").stat().st_size > 10**6
        rows.append(("compose: press in the hub's", "a face; all five containers healthy"))
        rows.append(("compose: a visit", visit(f"http://localhost:{port}")))
        memory = {name: sum(one.memory_full_info().pss for one in (
            box.first(), *box.first().children(recursive=True))) / 2**20
            for name, box in boxes.items()}
        rows.append(("compose: memory, MiB", ", ".join(
            f"{name} {size:.0f}" for name, size in memory.items())))
        # One goes, and its health says so while the others go on.
        boxes["capture"].stop()
        until(lambda: hub.healthy(["denseface", "status", "--healthy", "hub"])
              and not hub.healthy(["denseface", "status", "--healthy", "sensor"]))
        stops = [box.stop() for name, box in boxes.items() if name != "capture"]
        assert {status for status, _ in stops} <= {0, 143}, stops
        rows.append(("compose: stopped", f"all within {max(s for _, s in stops):.1f} s"))
    return rows


def _filled(text: str) -> str:
    """Give a value of compose.yaml, of whose variables none is set."""
    return re.sub(r"\$\{\w+:-(.*?)\}", r"\1", text)
