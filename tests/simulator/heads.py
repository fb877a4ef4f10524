"""The heads that can be rendered: one made by code alone, and scans where they are at hand."""

import os
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.simulator import procedural
from tests.simulator.clip import clip_below
from tests.simulator.deformed import Deformed, Raised, displacement
from tests.simulator.landmarks import SCANS, Landmarks
from tests.simulator.surface import Surface
from tests.simulator.varied import MODEL, identity, stretch

__all__ = ["Head", "head_names", "load_head", "shared_folder"]

@dataclass(frozen=True, eq=False, kw_only=True)
class Head(Surface):
    """A head and neck.

    The head frame: x right, y down, z forward as a camera's; the face looks toward -z; the
    origin lies half-way from hairline to chin, as deep as the bridge of the nose.
    """

    name: str
    landmarks: Landmarks

    def face_region(self, points: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Say which points of the head, (..., 3) mm, head frame, belong to the face."""
        return self.landmarks.face_region(points)


def shared_folder() -> Path | None:
    """Give the folder of data that is not the project's own, or None where there is none."""
    folder = Path(os.environ.get("DENSEFACE_SHARED")
                  or Path(__file__).resolve().parents[2].parent / "shared")
    return folder if folder.is_dir() else None


def head_names() -> list[str]:
    """List the heads at hand: `procedural`, then the scans of the shared folder."""
    shared = shared_folder()
    scans = [name for name in SCANS if shared and (shared / "faces" / f"{name}.npz").is_file()]
    return ["procedural", *scans]


@lru_cache(maxsize=16)
def load_head(name: str) -> Head:
    """Load a head by its name.

    `NAME+KIND` for one of whose sides is deformed (`Deformed`, `Raised`), `NAME~SEED` for one of
    other proportions (`varied`).

    Raises
    ------
    ValueError
        Where no such head is at hand, or no such deformation is known.
    """
    name, _, kind = name.partition("+")
    if kind:
        head = load_head(name)
        raised = Raised.parse(kind)
        moved = (raised.displacement(head.vertices, head.normals, head.landmarks) if raised
                 else displacement(Deformed(kind), head.vertices, head.normals, head.landmarks))
        return replace(head, vertices=head.vertices + moved, name=f"{name}+{kind}")
    name, _, seed = name.partition("~")
    if name not in head_names():
        raise ValueError(f"head {name!r} is not at hand, expected one of {head_names()}")
    surface, landmarks = _built(name, int(seed) if seed else None)
    origin = np.array(landmarks.origin, np.float32)
    return Head(
        vertices=surface.vertices - origin, faces=surface.faces, colors=surface.colors,
        uv=surface.uv, texture=surface.texture, plain=surface.plain,
        name=name, landmarks=landmarks.relative_to_origin(),
    )


def _built(name: str, seed: int | None) -> tuple[Surface, Landmarks]:
    """Build a head in its mesh's own frame, of other proportions where there is a seed."""
    if name != "procedural":
        return _scan(name, seed)
    surface, marks = procedural.build(), procedural.LANDMARKS
    if seed is None:
        return surface, marks
    vertices, marks = stretch(surface.vertices, marks, seed)
    return replace(surface, vertices=vertices), marks


def _scan(name: str, seed: int | None) -> tuple[Surface, Landmarks]:
    folder, marks = (shared_folder() or Path()) / "faces", SCANS[name]
    with np.load(folder / f"{name}.npz", allow_pickle=False) as data:
        vertices, faces = data["V"], data["F"]
        colors = (np.ascontiguousarray(data["C"][:, ::-1]) if "C" in data
                  else np.zeros(vertices.shape, np.uint8))
        uv = data["T"][data["FT"]]
    if seed is not None and name == "ict_neutral" and (folder / MODEL).is_file():
        vertices, marks = identity(vertices, marks, seed, folder)
    elif seed is not None:
        vertices, marks = stretch(vertices, marks, seed)
    picture = folder / f"{name}.jpg"
    if not picture.is_file():
        uv, texture = None, None
        colors = _made_up(vertices, colors, marks)
    else:
        uv = np.stack([uv[..., 0], 1 - uv[..., 1]], axis=-1)
        texture = _picture(picture)
    plain = colors[faces].any(axis=2).all(axis=1)
    surface = Surface(vertices=vertices, faces=faces, colors=colors, uv=uv, texture=texture,
                      plain=plain)
    return clip_below(surface, marks.neck[1]), marks


def _picture(path: Path) -> NDArray[np.uint8]:
    image = cv2.imread(str(path))
    if image is None:
        raise ValueError(f"{path}: expected a picture that OpenCV reads")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)


def _made_up(
    vertices: NDArray[np.float32], colors: NDArray[np.uint8], marks: Landmarks
) -> NDArray[np.uint8]:
    """Give a head of one skin colour and white eyeballs irises, brows, lips and cropped hair."""
    x, y, z = np.abs(vertices[:, 0]), vertices[:, 1], vertices[:, 2]
    ex, ey, ez = marks.eyes
    white = colors.min(axis=1) > 200
    out = colors.copy()
    brow = (np.hypot((x - ex - 2) / 19, (y - ey + 19) / 4.5) < 1) & (z < ez + 20) & ~white
    lips = (np.hypot(x / 24, (y - marks.mouth[0]) / 9) < 1) & (z < marks.mouth[1] + 18) & ~white
    iris = (np.hypot(x - ex, y - ey) < 5.5) & white & (z < ez + 5)
    hair = ~marks.face_region(vertices) & (y < marks.ear_bottom[0]) & ~white
    hair &= (z > marks.ear_top[1] + 30) | (y < marks.ear_top[0] - 8)
    for where, color in ((hair, (74, 60, 50)), (brow, (86, 64, 52)), (lips, (178, 104, 98)),
                         (iris, (60, 44, 36))):
        out[where] = color
    return out
