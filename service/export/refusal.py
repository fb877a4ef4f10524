"""A picture of a frame that became no face, to see why: its images, and what looked like a face."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.arguments import expect
from denseface.capture.frame import RgbdFrame
from denseface.recon.face import FaceCandidate
from denseface.recon.registration import with_shaded_depth
from denseface.service.export._drawing import BACKGROUND, FAINT_INK, INK, png, width, write
from denseface.service.export.provenance import frame_provenance

__all__ = ["draw_refusal"]

_PANEL = 640
"""Width of each image, pixels."""
_MARGIN, _HEADER, _LINE = 14, 62, 26
"""Around the images; of the lines above them, pixels."""
_NEAREST_MM, _FARTHEST_MM = 300.0, 2000.0
"""Depths between which colours change: where a face is looked for."""
_DARKEST = 25
"""Of the colours of `COLORMAP_TURBO`, the first that is not nearly black."""
_BOX = (255, 196, 64)
"""RGB, of a box and what is said of it."""
_SHADOW = (0, 0, 0)
_LETTERS = 92
"""That fit a line of the header."""


def draw_refusal(frame: RgbdFrame, candidates: Sequence[FaceCandidate], reason: str) -> bytes:
    """Draw a frame without a face as a PNG file.

    Left the colour image, or its shaded depth where there is none, with the detector's boxes, each
    with its verdict, width and distance; right the depth, black where nothing was measured.

    Parameters
    ----------
    candidates : `ReconstructionError.candidates`
    reason : why it is none, one line
    """
    expect("frame", frame, RgbdFrame)
    lines = _wrapped(reason)
    top = _HEADER + _LINE * len(lines)
    seen = with_shaded_depth(frame).rgb
    left_image, right_image = _fitted(seen), _depth(frame)
    height = max(len(left_image), len(right_image))
    canvas = np.full((top + height + _MARGIN, 2 * _PANEL + 3 * _MARGIN, 3), BACKGROUND, np.uint8)
    for at, line in enumerate(lines):
        write(canvas, line, (_MARGIN, _LINE * (at + 1) + 4), 0.7, INK)
    second = 2 * _MARGIN + _PANEL
    titles = ((_MARGIN, _title(frame, candidates)),
              (second, f"depth: {_measured(frame)}, red 0.3 m, blue 2 m and farther"))
    for left, title in titles:
        write(canvas, title, (left, top - 14), 0.5, FAINT_INK)
    for left, image in ((_MARGIN, left_image), (second, right_image)):
        canvas[top:top + len(image), left:left + _PANEL] = image
    part = canvas[top:top + len(left_image), _MARGIN:_MARGIN + _PANEL]
    for candidate in _apart(candidates):
        _draw_box(part, candidate, _PANEL / seen.shape[1])
    return png(canvas, frame_provenance(frame))


def _depth(frame: RgbdFrame) -> NDArray[np.uint8]:
    z = frame.depth * (frame.depth_meaning.unit_um / 1000)
    # Equal steps of the logarithm: the sensor's own steps grow with distance, too.
    near = np.log(_FARTHEST_MM / np.clip(z, _NEAREST_MM, _FARTHEST_MM))
    near /= np.log(_FARTHEST_MM / _NEAREST_MM)
    shade = (_DARKEST + near * (255 - _DARKEST)).astype(np.uint8)
    image = np.asarray(cv2.applyColorMap(shade, cv2.COLORMAP_TURBO)[:, :, ::-1]).copy()
    image[frame.depth == 0] = 0
    return _fitted(image)


def _fitted(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Give an image the width of a panel."""
    rows = max(1, min(round(len(image) * _PANEL / image.shape[1]), 2 * _PANEL))
    how = cv2.INTER_AREA if image.shape[1] > _PANEL else cv2.INTER_NEAREST
    return np.asarray(cv2.resize(image, (_PANEL, rows), interpolation=how), np.uint8)


def _title(frame: RgbdFrame, candidates: Sequence[FaceCandidate]) -> str:
    boxes = len(_apart(candidates))
    image = "colour" if frame.color is not None else "no colour camera; depth as a relief"
    return f"{image}: {boxes or 'nothing'} looked like a face"


def _measured(frame: RgbdFrame) -> str:
    return f"{np.count_nonzero(frame.depth) / frame.depth.size:.0%} measured"


def _apart(candidates: Sequence[FaceCandidate]) -> list[FaceCandidate]:
    """Give one of each group of boxes that lie in the same place and have one verdict."""
    kept: list[FaceCandidate] = []
    for one in candidates:
        if not any(one.verdict == other.verdict and _same_place(one, other) for other in kept):
            kept.append(one)
    return kept


def _same_place(one: FaceCandidate, other: FaceCandidate) -> bool:
    reach = (one.box[2] + other.box[2]) / 4
    return all(abs((a + p / 2) - (b + q / 2)) < reach for a, b, p, q in zip(
        one.box[:2], other.box[:2], one.box[2:], other.box[2:], strict=True))


def _draw_box(image: NDArray[np.uint8], candidate: FaceCandidate, scale: float) -> None:
    x, y, w, h = (round(side * scale) for side in candidate.box)
    said = ["the face that was taken" if candidate.verdict == "chosen" else candidate.verdict]
    if candidate.depth_mm is not None and candidate.width_mm is not None:
        said.append(f"{candidate.width_mm:.0f} mm wide at {candidate.depth_mm / 1000:.2f} m")
    for thick, ink in ((4, _SHADOW), (2, _BOX)):
        cv2.rectangle(image, (x, y), (x + w, y + h), ink, thick, cv2.LINE_AA)
    for line, text in enumerate(said):
        length = width(text, 0.48)
        at = max(4, min(x + 6, image.shape[1] - length - 4)), max(y, 0) + 18 + 18 * line
        cv2.rectangle(image, (at[0] - 3, at[1] - 13), (at[0] + length + 3, at[1] + 5), _SHADOW,
                      cv2.FILLED)
        write(image, text, at, 0.48, _BOX)


def _wrapped(text: str) -> list[str]:
    """Break a text into lines that fit; of ASCII, as OpenCV's letters are."""
    import textwrap

    return textwrap.wrap(text.encode("ascii", "replace").decode(), _LETTERS)[:4]
