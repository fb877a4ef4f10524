"""The pictures of docs/tutorial.md, by its own commands and `denseface view`.

`python -m bench.page_pictures`, after script/bootstrap --tests.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import trimesh
from playwright.sync_api import Browser

from denseface.recon.arrays import Bytes
from tests.viewer_page import software_browser

__all__: list[str] = []

_RECORDING = Path("fixtures/recorded_oni/frontal_700.oni").resolve()
_DENSEFACE = (sys.executable, "-m", "denseface")
_QUALITY = (cv2.IMWRITE_JPEG_QUALITY, 84)
_DRAWN_MS = 6000
"""Until a mesh is there, on a machine without a graphics card."""


def _view(browser: Browser, path: Path, width: int, height: int) -> Bytes:
    """Open `denseface view` of a file, and give a picture of the page, BGR."""
    with subprocess.Popen([*_DENSEFACE, "view", path, "--no-browser"], text=True,
                          stdout=subprocess.PIPE) as viewer:
        try:
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(next(iter(viewer.stdout or ())).strip())
            page.wait_for_timeout(_DRAWN_MS)
            page.screenshot(path=path.with_suffix(".page.png"))
        finally:
            viewer.terminate()
    return _read(path.with_suffix(".page.png"))


def _read(path: Path) -> Bytes:
    image = cv2.imread(str(path))
    if image is None:
        raise OSError(f"{path}: no picture")
    return np.asarray(image, np.uint8)


def _solid(browser: Browser, mesh: trimesh.Trimesh, name: Path, turned: list[float]) -> Bytes:
    """Draw a printed solid from above, turned about x, y and z by degrees."""
    shown = mesh.copy()
    # The viewer looks along z with y down; on the bed z is up.
    shown.apply_transform(trimesh.transformations.rotation_matrix(np.pi, [1, 0, 0]))
    for degrees, axis in zip(turned, np.eye(3), strict=True):
        shown.apply_transform(trimesh.transformations.rotation_matrix(np.deg2rad(degrees), axis))
    shown.export(name)
    middle = _view(browser, name, 1000, 700)[60:, :660]
    return np.asarray(middle[:, 120:540], np.uint8)


def main() -> int:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default="docs/pictures")
    folder = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as name, software_browser() as browser:
        desk = Path(name)
        for line in (f"reconstruct {_RECORDING} -o face.npz --preview face.png",
                     "export face.npz -o relief.stl",
                     "export face.npz -o mask.stl --solid mask --wall 2 --height 80"):
            subprocess.run([*_DENSEFACE, *line.split()], cwd=desk, check=True)
        cv2.imwrite(str(folder / "tutorial_preview.jpg"), cv2.resize(
            _read(desk / "face.png"), None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA), _QUALITY)
        cv2.imwrite(str(folder / "tutorial_view.jpg"),
                    _view(browser, desk / "face.npz", 1180, 720), _QUALITY)
        relief, mask = (trimesh.load_mesh(desk / f"{solid}.stl") for solid in ("relief", "mask"))
        cv2.imwrite(str(folder / "tutorial_solids.jpg"), np.concatenate([
            _solid(browser, relief, desk / "1.stl", [0, 28, 0]),
            _solid(browser, mask, desk / "2.stl", [0, 28, 0]),
            _solid(browser, mask, desk / "3.stl", [0, 160, 0])], axis=1), _QUALITY)
    for path in sorted(folder.glob("tutorial_*.jpg")):
        sys.stdout.write(f"{path}: {path.stat().st_size / 1000:.0f} kB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
