"""A scene put together for ray casting."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.simulator import body, room
from tests.simulator.caster import Caster
from tests.simulator.hair import beard, hair
from tests.simulator.heads import Head, load_head
from tests.simulator.labels import Label
from tests.simulator.scene import Person, Scene
from tests.simulator.surface import Surface

__all__ = ["Hits", "World", "build_world", "dot"]

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Hits:
    """What each of n rays met first.

    Attributes
    ----------
    distance : (n,) float32, in units of the ray's direction vector, inf where nothing
    part : (n,) int32, index into `World.parts`, -1 where nothing
    triangle : (n,) int64, index into that part's faces, 0 where nothing
    weights : (n, 3) float32, barycentric
    """

    distance: Floats
    part: NDArray[np.int32]
    triangle: NDArray[np.int64]
    weights: Floats

    @cached_property
    def by_part(self) -> list[tuple[int, NDArray[np.int64]]]:
        """The rays that met each part: (its index, indices of the rays)."""
        order = np.argsort(self.part.astype(np.int16), kind="stable")
        parts, starts = np.unique(self.part[order], return_index=True)
        return [(int(part), rays) for part, rays in
                zip(parts, np.split(order, starts[1:]), strict=True) if part >= 0]

    @cached_property
    def on_parts(self) -> list[tuple[int, NDArray[np.int64], NDArray[np.int64], Floats]]:
        """The same with the triangles and weights of these rays."""
        return [(part, rays, self.triangle[rays], self.weights[rays])
                for part, rays in self.by_part]


@dataclass(frozen=True, eq=False)
class _Part:
    surface: Surface
    placed: Floats
    """(n, 3) mm, depth camera frame."""
    normals: Floats
    """(n, 3) unit vectors, depth camera frame."""
    label: Label
    gain: tuple[float, float, float]
    head: Head | None
    """The head whose surface this is."""
    target: bool
    strands: bool
    """Hair, or a beard."""


class World:
    """Every surface of a scene in the depth camera's frame, ready for ray casting."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.parts: list[_Part] = []
        for index, person in enumerate(scene.people):
            self._add_person(person, target=index == scene.target)
        backdrop = (room.room(scene.decor) if scene.wall_mm is None
                    else room.wall(scene.wall_mm, scene.decor, scene.wall_color))
        for surface in backdrop:
            self._add(surface, np.eye(3), np.zeros(3), Label.BACKGROUND)
        self._caster = Caster()
        for part in self.parts:
            self._caster.add(part.placed, part.surface.faces)

    def cast(self, origin: NDArray[np.floating], directions: NDArray[np.floating]) -> Hits:
        """Cast rays from one point, (3,) mm, along (n, 3) directions."""
        return Hits(*self._caster.cast(origin, directions))

    def visible(self, points: Floats, origin: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Say which points, (n, 3) mm, a straight line from `origin`, (3,) mm, reaches."""
        # Start a little off the surface, or each point would hide itself.
        way = np.asarray(origin, np.float32) - points
        away = np.sqrt(dot(way, way))
        way /= away[:, None]
        return ~self._caster.blocked(points + 1.0 * way, way, float(away.max(initial=1.0)))

    def normals(self, hits: Hits) -> Floats:
        """Give the unit normals, (n, 3), depth camera frame, outward as the mesh is wound."""
        out = np.zeros((len(hits.part), 3), np.float32)
        for part, chosen, triangle, weights in self._each(hits):
            normal = np.einsum("kc,kcd->kd", weights,
                               part.normals[part.surface.faces[triangle]])
            out[chosen] = normal / np.maximum(np.sqrt(dot(normal, normal)), 1e-9)[:, None]
        return out

    def colors(self, hits: Hits, *, head_only: bool = False) -> Floats:
        """Give the surfaces' own linear colour, (n, 3), 0-1, before any light falls on it.

        Zero off the target's head where `head_only`.
        """
        out = np.zeros((len(hits.part), 3), np.float32)
        for part, chosen, triangle, weights in self._each(hits):
            if head_only and not (part.target and part.head):
                continue
            srgb = part.surface.colors_at(triangle, weights)
            out[chosen] = np.minimum((srgb / 255) ** 2.2 * np.array(part.gain, np.float32), 1)
        return out

    def labels(self, hits: Hits) -> NDArray[np.uint8]:
        """Give what each ray met, (n,) uint8 of `Label`."""
        out = np.zeros(len(hits.part), np.uint8)
        for part, chosen, triangle, weights in self._each(hits):
            label = np.full(len(triangle), part.label, np.uint8)
            if part.head is not None and part.target:
                label[part.head.face_region(_points(part.surface, triangle, weights))] = Label.FACE
            out[chosen] = label
        return out

    def on_head(self, hits: Hits) -> Floats:
        """Give the hit points in the target head's own frame, mm at the mesh's scale.

        (n, 3) float32, NaN off the target's head and hair.
        """
        out = np.full((len(hits.part), 3), np.nan, np.float32)
        for part, chosen, triangle, weights in self._each(hits):
            if (part.head is not None or part.strands) and part.target:
                out[chosen] = _points(part.surface, triangle, weights)
        return out

    def on_hair(self, hits: Hits) -> NDArray[np.bool_]:
        """Say which rays met the target's hair or beard, (n,)."""
        out = np.zeros(len(hits.part), bool)
        for index, chosen in hits.by_part:
            out[chosen] = self.parts[index].strands and self.parts[index].target
        return out

    def _each(
        self, hits: Hits
    ) -> Iterator[tuple[_Part, NDArray[np.int64], NDArray[np.int64], Floats]]:
        for index, chosen, triangle, weights in hits.on_parts:
            yield self.parts[index], chosen, triangle, weights

    def _add_person(self, person: Person, *, target: bool) -> None:
        head = load_head(person.head)
        marks = head.landmarks
        R, t = person.rotation, person.shift

        def add(surface: Surface, rotation: NDArray[np.float64], shift: NDArray[np.float64],
                label: Label, **more: Any) -> None:
            self._add(surface, rotation, shift, label if target else Label.OTHER_PERSON,
                      scale=person.scale, target=target, **more)

        add(head, R, t, Label.HEAD, gain=person.skin_gain, head=head)
        if person.hair:
            add(hair(head, marks), R, t, Label.HEAD, strands=True)
        if person.beard:
            add(beard(head, marks), R, t, Label.HEAD, strands=True)
        if person.shoulders:
            half, y, z, depth = marks.neck
            base = R @ np.array([0, y, z])
            add(body.torso((half, 0.0, 0.0, depth)), np.eye(3), t + person.scale * base,
                Label.BODY)
        if person.glasses:
            add(body.glasses(marks), R, t, Label.GLASSES)
        if person.hand:
            add(body.hand(marks), R, t, Label.HAND, gain=person.skin_gain)

    def _add(self, surface: Surface, rotation: NDArray[np.float64], shift: NDArray[np.float64],
             label: Label, *, scale: float = 1.0, gain: tuple[float, float, float] = (1, 1, 1),
             head: Head | None = None, target: bool = False, strands: bool = False) -> None:
        placed = (scale * surface.vertices @ rotation.T + shift).astype(np.float32)
        normals = (surface.normals @ rotation.T).astype(np.float32)
        self.parts.append(_Part(surface, placed, normals, label, gain, head, target, strands))


@lru_cache(maxsize=4)
def build_world(scene: Scene) -> World:
    """Build a scene's world, or give the same one again."""
    return World(scene)


def dot(one: NDArray[np.floating], other: NDArray[np.floating]) -> NDArray[np.floating]:
    """Multiply vectors, (n, 3) each, and give (n,): NumPy's own sum over so few is slow."""
    x, y, z = (one * other).T
    product: NDArray[np.floating] = (x + y) + z
    return product


def _points(surface: Surface, triangle: NDArray[np.int64], weights: Floats) -> Floats:
    points: Floats = np.einsum("kc,kcd->kd", weights, surface.vertices[surface.faces[triangle]])
    return points
