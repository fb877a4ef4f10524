"""Units as text: the templates, filled in for one machine."""

import re
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from denseface.service.errors import UsageError
from denseface.service.tools.units.program import Program

__all__ = ["INSTANCES", "TARGET", "Choice", "render"]

TARGET = "denseface.target"
"""Starts and stops all others."""
INSTANCES = "denseface-worker@.service", "denseface-capture@.service"
"""Those of which further ones may be enabled."""
_SERVICES = ("denseface-hub.service", "denseface-capture.service", "denseface-worker@.service",
             "denseface-kiosk.service")
_SENSOR = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
_OF_USERS = frozenset((
    "EnvironmentFile", "ExecStart", "LimitCORE", "LockPersonality", "MemoryDenyWriteExecute",
    "MemoryMax", "NoNewPrivileges", "OOMPolicy", "Restart", "RestartPreventExitStatus",
    "RestartSec", "RestrictAddressFamilies", "RestrictNamespaces", "RestrictRealtime",
    "RestrictSUIDSGID", "SystemCallArchitectures", "SystemCallErrorNumber", "SystemCallFilter",
    "TasksMax", "TimeoutStartSec", "TimeoutStopSec", "Type", "UMask", "WatchdogSec",
    "WatchdogSignal"))
"""What a user's own manager can do, and is of use there, of the lines of a service."""


@dataclass(frozen=True)
class Choice:
    """What is to run on the machine."""

    workers: int
    sensors: tuple[str, ...] = ()
    """Names of several; where there are none, one process has the first sensor."""
    kiosk: bool = True
    user: bool = False
    """Whether the units are of a user's own manager."""

    def __post_init__(self) -> None:
        for name in self.sensors:
            if not _SENSOR.fullmatch(name):
                raise UsageError(f"--sensor {name}: expected letters, digits, - _ and ., at most "
                                 "64, as it is part of a unit's name")
            if self.sensors.count(name) > 1:
                raise UsageError(f"--sensor {name}: given twice, expected another name each")


def render(choice: Choice, program: Program) -> dict[str, str]:
    """Give the units' texts by their names, the target last."""
    texts = {name: _service(_template(name), program) for name in _SERVICES}
    # One sensor of several has the name of its instance, and settings of its own.
    texts["denseface-capture@.service"] = texts["denseface-capture.service"].replace(
        ": the sensor", " %i: a sensor").replace(
        " capture --source", " capture --name %i --source").replace(
        "/capture.env", "/capture-%i.env") + f"\n[Install]\nWantedBy={TARGET}\n"
    wanted = ["denseface-hub.service",
              *([f"denseface-capture@{name}.service" for name in choice.sensors]
                or ["denseface-capture.service"]),
              *(f"denseface-worker@{number}.service" for number in range(1, choice.workers + 1)),
              *(["denseface-kiosk.service"] if choice.kiosk else [])]
    texts[TARGET] = _template(TARGET).replace("@WANTS@", " ".join(wanted))
    return {name: _for_user(text) for name, text in texts.items()} if choice.user else texts


@cache
def _template(name: str) -> str:
    return (files(__package__) / "templates" / name).read_text("utf-8")


def _service(template: str, program: Program) -> str:
    hardening = _template("hardening.conf").rstrip()
    if program.homes:
        hardening = hardening.replace(
            "ProtectHome=yes",
            "# denseface is installed in a home folder: nothing else of any home is seen.\n"
            f"ProtectHome=tmpfs\nBindReadOnlyPaths={' '.join(program.homes)}")
    return template.replace("@HARDENING@", hardening).replace("@PROGRAM@", program.command)


def _for_user(text: str) -> str:
    """Leave what a user's own manager can do."""
    text = text.replace("WantedBy=multi-user.target", "WantedBy=default.target")
    section, kept = "", []
    for paragraph in text.rstrip().split("\n\n"):
        lines = []
        for line in paragraph.splitlines():
            section = line if line.startswith("[") else section
            if section != "[Service]" or line[0] in "[#" or line.partition("=")[0] in _OF_USERS:
                lines.append(line)
        if any(line[0] != "#" for line in lines):  # else there is nothing left to explain
            kept.append("\n".join(lines))
    return "\n\n".join(kept) + "\n"
