"""How large an image is, and what of."""

import json
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.container.box import Image, say

__all__ = ["sizes"]


def sizes(image: Image) -> Iterator[tuple[str, str]]:
    """How large it is, as a whole, by layers, and what is largest in it."""
    with tempfile.TemporaryDirectory() as scratch:
        say("buildah", "push", "--format", "oci", "--compression-format", "gzip", image.name,
             f"oci:{scratch}/oci")
        blobs = Path(scratch) / "oci/blobs/sha256"
        index = json.loads((blobs.parents[1] / "index.json").read_text())

        def blob(of: dict[str, Any]) -> Path:
            path: Path = blobs / of["digest"].partition(":")[2]
            return path

        manifest = json.loads(blob(index["manifests"][0]).read_text())
        layers = [(one["size"] / 1e6, _unpacked_size(blob(one)) / 1e6)
                  for one in manifest["layers"]]
    yield ("size, MB", f"{sum(whole for _, whole in layers):.0f}, compressed "
                       f"{sum(packed for packed, _ in layers):.0f}")
    yield ("layers, MB", ", ".join(f"{whole:.0f} ({packed:.0f})" for packed, whole in layers))
    packages = next(image.root.glob("opt/denseface/lib/python3*/site-packages"))
    by_size: dict[str, float] = {}
    for one in packages.rglob("*"):
        if one.is_file() and not one.is_symlink():
            name = one.relative_to(packages).parts[0].partition(".")[0].partition("-")[0]
            by_size[name] = by_size.get(name, 0) + one.stat().st_size / 1e6
    largest = sorted(by_size.items(), key=lambda one: -one[1])[:8]
    yield "packages, MB", ", ".join(f"{name} {size:.0f}" for name, size in largest)
    for ending, what in ((".pyc", "compiled modules, MB"), (".nbc", "kernels, MB")):
        size = sum(one.stat().st_size for one in packages.rglob(f"*{ending}")) / 1e6
        yield what, f"{size:.0f}"


def _unpacked_size(blob: Path) -> int:
    with subprocess.Popen(["gzip", "-dc", blob], stdout=subprocess.PIPE) as unpacking:
        assert unpacking.stdout is not None
        size = 0
        while chunk := unpacking.stdout.read(2**20):
            size += len(chunk)
    return size
