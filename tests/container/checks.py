"""What is tried of an image by itself."""

import re
import time
from contextlib import ExitStack
from pathlib import Path

from tests.container.box import RECORDINGS, SENSOR, Box, Image, say, volumes
from tests.waiting import until

__all__ = ["answers", "compiles_elsewhere", "holds_nothing_else", "serves"]

_COMPILERS = re.compile(r"(.*-)?(gcc|g\+\+|cc|c\+\+|cpp|ld|as|clang|tcc|rustc|make)(-[0-9.]+)?")


def holds_nothing_else(image: Image) -> str:
    """No compiler, no pip, no program that makes anybody root, no lists and no secrets."""
    files = [one for one in image.root.rglob("*") if one.is_file() and not one.is_symlink()]
    links = [one for one in image.root.rglob("*") if one.is_symlink()]
    found = [str(one) for one in (*files, *links)
             if _COMPILERS.fullmatch(one.name) and "bin" in one.parts]
    found += [str(one) for one in files if one.stat().st_mode & 0o6000]
    found += [str(one) for one in (image.root / "run/secrets").glob("*")]
    found += [str(one) for one in (image.root / "var/lib/apt/lists").rglob("*") if one.is_file()]
    found += [str(one) for one in image.root.rglob("site-packages/pip")]
    assert not found, found
    without = [one.parent.name for one in image.root.rglob("*.dist-info/METADATA")
               if not any(re.match("licen[sc]e|copying|notice", file.name, re.IGNORECASE)
                          for file in one.parent.rglob("*"))]
    return f"{len(files):,} files; without a file of their licence: {', '.join(without) or 'none'}"


def answers(image: Image) -> str:
    """`--version`, a face of a recording and `bench`, by `buildah run`."""
    with ExitStack() as stack:
        faces = volumes(stack, "/out")["/out"]
        container = say("buildah", "from", "--pull-never", image.name)
        stack.callback(say, "buildah", "rm", container)

        def run(*command: str) -> str:
            return say("buildah", "run", "--isolation", "chroot", "--network", "host", "--user",
                        "12345:0", "--volume", f"{RECORDINGS}:/mnt:ro", "--volume",
                        f"{faces}:/out", container, "--", "denseface", *command)

        version = run("--version")
        run("reconstruct", "/mnt/frontal_700.oni", "-o", "/out/face.ply")
        size = (faces / "face.ply").stat().st_size
        assert size > 10**6
        run("bench", "--quick", "/mnt/frontal_700.oni")
    return f"denseface {version}, a face of {size / 1e6:.1f} MB"


def serves(image: Image, user: str) -> str:
    """`up` as any user: press, health, no kernel compiled, and an orderly end."""
    with ExitStack() as stack:
        own = volumes(stack, "/data", "/faces")
        box = Box(image, [*image.command, "--source", SENSOR, "--no-kiosk"], user=user,
                  volumes=own)
        stack.callback(box.end)
        began = time.monotonic()
        box.say("denseface", "status", "--wait", "120")
        waited = time.monotonic() - began
        box.say("denseface", "press", "--save", "/faces/face.ply")
        assert box.healthy()
        face = own["/faces"] / "face.ply"
        assert face.stat().st_uid == int(user.partition(":")[0])
        compiled = list((own["/data"] / ".cache").rglob("*.nb?"))
        assert not compiled, f"{len(compiled)} kernels were compiled"
        box.say("sh", "-c", "! touch /opt/x 2>/dev/null")
        # Whoever left a process behind: it is reaped, and is no zombie for ever.
        before = len(box.first().children(recursive=True))
        box.say("sh", "-c", "(sh -c 'sleep 0.1' &) ; exit 0")
        until(lambda: len(box.first().children(recursive=True)) <= before)
        processes = [box.first(), *box.first().children(recursive=True)]
        memory = sum(one.memory_full_info().pss for one in processes)
        status, seconds = box.stop()
        assert status in (0, 143), status
        assert not list((own["/data"] / "hub/frames").glob("*.pending"))
    return (f"a face of {face.name if face.exists() else 'one press'}, ready after {waited:.1f} s, "
            f"{memory / 2**20:.0f} MiB, stopped in {seconds:.1f} s with status {status}")


def compiles_elsewhere(image: Image) -> str:
    """Another processor: kernels are compiled once, into the volume of /data."""
    with ExitStack() as stack:
        own = volumes(stack, "/data", "/faces")
        seconds = []
        for _ in range(2):
            box = Box(image, ["warm"], user="12345:0", volumes=own,
                      environment={"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""})
            stack.callback(box.end)
            began = time.monotonic()
            assert box.process.wait(timeout=1200) == 0, Path(box.log.name).read_text()
            seconds.append(time.monotonic() - began)
        kernels = len(list((own["/data"] / ".cache").rglob("*.nbc")))
        assert kernels > 50, kernels
    return f"{kernels} kernels in {seconds[0]:.0f} s, the next start {seconds[1]:.1f} s"
