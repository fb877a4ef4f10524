"""The subcommands, one module each: flags, and what is called with them.

Each is a `Command` and imports what is heavy in `run`: `denseface --help` is to be quick.
"""

import argparse
from importlib import import_module
from typing import Protocol, cast

__all__ = ["COMMANDS", "Command", "load"]

COMMANDS = {
    "reconstruct": "make dense faces of frames in files and folders",
    "batch": "make faces of archives, on many cores or machines, with a summary",
    "view": "look at faces, frames and recordings in a browser, or in rerun",
    "compare": "lay two faces on each other and say what changed",
    "evaluate": "measure how near faces are to a known true surface",
    "doctor": "look for what keeps a sensor from working",
    "calibrate": "find both cameras and their pose by a board that they see",
    "live": "reconstruct a source frame after frame and show the times",
    "record": "record a sensor, or any source, to a file or folder",
    "export": "write a face in another format, also for 3D printing",
    "info": "say what a file is: a face, a frame, a recording, a calibration",
    "up": "run the whole service on this machine",
    "press": "take a frame now and wait for its face",
    "get": "fetch a capture that the hub keeps: its face, its frame",
    "list": "list the captures that the hub keeps",
    "subscribe": "follow the faces as they are published",
    "dead": "list, retry or drop captures that were given up",
    "purge": "remove captures: frame, face, report and row",
    "status": "say who is connected to the hub and what was done",
    "keys": "make keys, and say which may connect from other machines",
    "hub": "run the hub alone",
    "capture": "run a capture process alone",
    "worker": "run a reconstruction worker alone",
    "warm": "compile now what the first start would otherwise wait for",
    "install-units": "have systemd start hub, sensor, workers and kiosk with this machine",
    "bench": "measure how fast this machine makes faces",
    "completion": "print what a shell needs to complete commands and flags",
    "kiosk": "run the page alone where visitors see their own face",
}
"""What each does, by the name of its module, in the order of `denseface --help`."""

_SUBROOMS = (dict.fromkeys(("calibrate", "doctor", "record"), "sensor")
             | dict.fromkeys(("get", "list"), "captures")
             | dict.fromkeys(("batch", "export", "info"), "files")
             | dict.fromkeys(("compare", "evaluate"), "comparing")
             | dict.fromkeys(("bench", "completion", "install-units", "warm"), "machine"))
"""Where a command's module is, if not here."""


class Command(Protocol):
    """A subcommand's module."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's flags."""

    def run(self, args: argparse.Namespace) -> int:
        """Run the command and give its exit status."""


def load(name: str) -> Command:
    """Import a command's module."""
    module = name.replace("-", "_")
    if name in _SUBROOMS:
        module = f"{_SUBROOMS[name]}.{module}"
    return cast("Command", import_module(f"denseface.service.commands.{module}"))
