"""Processes in an image, run as a container's are, without a container engine."""

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import psutil

from tests.waiting import until

__all__ = ["LIMIT_S", "RECORDINGS", "SENSOR", "Box", "Image", "say", "unpacked", "volumes"]

RECORDINGS = Path(__file__).resolve().parents[2] / "fixtures/recorded_oni"
SENSOR = "/mnt/frontal_700.oni?rate=real"
"""A sensor, in every box."""
LIMIT_S = 300.0
"""Longest wait for anything, seconds."""
_SETUP = """\
set -eu
mount --bind "$1" "$1"
mount -o remount,bind,ro "$1"
mount -t proc proc "$1/proc"
mount -t tmpfs -o nosuid,nodev,mode=1777 tmpfs "$1/tmp"
mount -t tmpfs -o mode=755 tmpfs "$1/dev"
for one in null zero full random urandom; do
    touch "$1/dev/$one"
    mount --bind "/dev/$one" "$1/dev/$one"
done
root=$1 volumes=$2 user=$3 network=$4
shift 4
while [ "$volumes" -gt 0 ]; do
    mount --bind "$1" "$root$2"
    [ "$3" = rw ] || mount -o remount,bind,ro "$root$2"
    shift 3
    volumes=$((volumes - 1))
done
exec chroot "$root" setpriv --reuid="${user%:*}" --regid="${user#*:}" --clear-groups \\
    --no-new-privs --bounding-set=-all --inh-caps=-all "$@"
"""


class Image:
    """An image, unpacked."""

    def __init__(self, name: str, root: Path, config: dict[str, Any]) -> None:
        self.name, self.root = name, root
        self.environment = dict(one.split("=", 1) for one in config["Env"])
        self.entry, self.command = config["Entrypoint"], config["Cmd"]
        self.folder, self.user = config["WorkingDir"], config["User"]
        self.health = config["Healthcheck"]["Test"][1:]


@contextmanager
def unpacked(name: str) -> Iterator[Image]:
    """Mount an image for as long as it is looked at."""
    container = say("buildah", "from", "--pull-never", name)
    try:
        root = Path(say("buildah", "mount", container))
        told = json.loads(say("buildah", "inspect", "--type", "image", name))
        yield Image(name, root, told["Docker"]["config"])
    finally:
        say("buildah", "rm", container)


class Box:
    """A process in the image as a container's first."""

    def __init__(
        self, image: Image, command: list[str], *, user: str, volumes: dict[str, Path],
        environment: dict[str, str] | None = None, network: bool = False,
    ) -> None:
        self._image, self._user, self._network = image, user, network
        self._variables = image.environment | (environment or {})
        mounts = {"/mnt": RECORDINGS, **volumes}
        parts = [part for there, here in mounts.items()
                 for part in (str(here), there, "ro" if there == "/mnt" else "rw")]
        self.log = tempfile.NamedTemporaryFile("r", suffix=".log")  # noqa: SIM115 - as long as this
        with Path(self.log.name).open("w") as log:
            self.process = subprocess.Popen(
                ["unshare", "--fork", "--kill-child=SIGKILL", "--pid", "--mount", "--uts",
                 *([] if network else ["--net"]), "sh", "-c",
                 f"hostname box{id(self):x}; {_SETUP}", "sh", str(image.root), str(len(mounts)),
                 user, "", *parts, *self._in_it([*image.entry, *command])],
                stdout=log, stderr=log, stdin=subprocess.DEVNULL)

    def _in_it(self, command: list[str]) -> list[str]:
        return ["env", "-i", *(f"{name}={value}" for name, value in self._variables.items()),
                "sh", "-c", f'cd {self._image.folder} && exec "$@"', "sh", *command]

    def first(self) -> psutil.Process:
        """Give its process 1."""
        def found() -> psutil.Process | None:
            # Before it is what it is to be, its root is not the image's.
            return next((one for one in psutil.Process(self.process.pid).children()
                         if one.name() == self._image.entry[0]), None)

        process = until(found)
        assert process
        return process

    def say(self, *command: str, fails: bool = False) -> str:
        """Run another command in it, as `docker exec` does, and give what it said."""
        inside = ["nsenter", "--target", str(self.first().pid), "--mount", "--pid", "--uts",
                  "--net", "--root", "--", "setpriv", f"--reuid={self._user.partition(':')[0]}",
                  f"--regid={self._user.partition(':')[2]}", "--clear-groups", "--no-new-privs",
                  "--bounding-set=-all", "--inh-caps=-all", *self._in_it(list(command))]
        done = subprocess.run(inside, check=False, capture_output=True, text=True,
                              timeout=LIMIT_S)
        said = done.stdout + done.stderr
        if bool(done.returncode) is not fails:
            raise AssertionError(f"{' '.join(command)}: status {done.returncode}: {said}\n"
                                 f"{Path(self.log.name).read_text()[-3000:]}")
        return said.strip()

    def healthy(self, test: list[str] | None = None) -> bool:
        """Ask the health check."""
        try:
            self.say(*(test or self._image.health))
        except AssertionError:
            return False
        return True

    def stop(self) -> tuple[int, float]:
        """Send SIGTERM to its process 1; give status and seconds."""
        began = time.monotonic()
        self.first().terminate()
        status = self.process.wait(timeout=30)
        return status, time.monotonic() - began

    def end(self) -> None:
        """Kill it, if it is there."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


def say(*command: str) -> str:
    """Run a command of this machine's and give what it said."""
    if command[0] == "buildah" and (driver := os.environ.get("STORAGE_DRIVER")):
        command = ("buildah", "--storage-driver", driver, *command[1:])
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def volumes(stack: ExitStack, *paths: str) -> dict[str, Path]:
    """Make new volumes, as an engine does: with the mode of the folder in the image."""
    made = {}
    for path in paths:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="denseface-")))
        folder.chmod(0o1777)
        made[path] = folder
    return made
