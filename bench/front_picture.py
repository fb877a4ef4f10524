"""The picture of README.md: a press, the depth frame it takes, the face that is made of it.

The kiosk's own page, a recording's frame, and the engine as they are:
`python -m bench.front_picture`, after script/bootstrap --tests.
"""

import argparse
import base64
import sys
from pathlib import Path

import cv2
import numpy as np

from denseface import Face, RgbdFrame, open_source, reconstruct
from denseface.recon.arrays import Bytes
from denseface.service.export import render as drawing
from tests.kiosk_states import serving
from tests.viewer_page import software_browser

__all__: list[str] = []

_RECORDING = Path("fixtures/recorded_oni/frontal_700.oni")
_PANEL = 440
"""Side of a picture, pixels."""
_DRAWN = 880
"""Side of a face as drawn, pixels."""
_NEAR_MM, _FAR_MM = 620, 940
_AROUND = (slice(110, 400), slice(165, 455))
"""Rows and columns of the depth image that are shown: the head."""
_PAGE = """<!doctype html><meta charset="utf-8"><style>
body { margin: 0; background: #14161b; color: #f2f0ec; font: 400 21px/1.35 "Noto Sans", sans-serif }
main { display: flex; gap: 0; padding: 28px 28px 22px; width: max-content; align-items: start }
figure { margin: 0; width: max-content }
img { display: block; height: 440px; border-radius: 14px }
figcaption { padding: 14px 4px 0; color: #b5b1aa }
b { display: block; color: #f2f0ec; font-weight: 600; font-size: 25px }
i { flex: none; width: 64px; height: 440px; display: grid; place-items: center;
    font: 400 44px/1 sans-serif; color: #ffb765 }
</style><main>PANELS</main>"""


def _depth(frame: RgbdFrame) -> Bytes:
    """Colour a depth image by distance, RGB: near is yellow, what was not read is black."""
    depth = frame.depth.astype(float)[_AROUND]
    near = np.clip((_FAR_MM - depth) / (_FAR_MM - _NEAR_MM), 0, 1) * 0.96
    shown = cv2.cvtColor(cv2.applyColorMap(np.uint8(255 * near), cv2.COLORMAP_INFERNO),
                         cv2.COLOR_BGR2RGB)
    shown[depth == 0] = 0
    return np.asarray(cv2.resize(
        shown, (_PANEL, _PANEL), interpolation=cv2.INTER_NEAREST), np.uint8)


def _faces(face: Face) -> Bytes:
    """Draw the colours and the shape, as `--preview` does."""
    points, colors, normals = drawing._subdivided(face.dense)
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    scale = drawing._scale(points, _DRAWN)
    pixels, rows = drawing._visible(points, scale, 0.0, face.dense.grid_step_mm, _DRAWN)
    panels = [drawing._panel(pixels, shown[rows], _DRAWN)[:, _DRAWN // 7:-_DRAWN // 7]
              for shown in (colors, drawing.shade(normals))]
    both = np.concatenate(panels, axis=1)
    wide = round(_PANEL * both.shape[1] / both.shape[0])
    return np.asarray(cv2.resize(both, (wide, _PANEL), interpolation=cv2.INTER_AREA), np.uint8)


def _url(image: Bytes) -> str:
    png = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1].tobytes()
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"


def main() -> int:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path, nargs="?", default="docs/pictures/press_to_face.jpg")
    path = parser.parse_args().path
    with open_source(str(_RECORDING)) as source:
        frame = next(iter(source))
    face = reconstruct(frame)
    with serving() as kiosk, software_browser() as browser:
        page = browser.new_page(viewport={"width": 560, "height": 660})
        page.goto(kiosk.url)
        page.wait_for_function("document.body.innerText.length > 20")
        kiosk.show("position_well")
        page.wait_for_timeout(1500)
        press = f"data:image/png;base64,{base64.b64encode(page.screenshot()).decode()}"
        height, width = frame.depth.shape
        panels = "<i>→</i>".join(
            f'<figure><img src="{picture}"><figcaption><b>{title}</b>{text}</figcaption></figure>'
            for picture, title, text in (
                (press, "One press", "a button, a key, a program"),
                (_url(_depth(frame)), "One depth frame", f"{width} × {height}, and its colours"),
                (_url(_faces(face)), "One dense face",
                 f"{len(face.initial):,} points measured, {len(face.dense):,} made of them")))
        page = browser.new_page(viewport={"width": 1600, "height": 600})
        page.set_content(_PAGE.replace("PANELS", panels))
        page.locator("main").screenshot(path=path, type="jpeg", quality=86)
    sys.stdout.write(f"{path}: {path.stat().st_size / 1000:.0f} kB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
