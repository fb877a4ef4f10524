"""Breaks a message: its bytes, its parts, and above all what its header says."""

import json
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

from tests.fuzzing.corpus import Parts
from tests.fuzzing.values import RAW, values

__all__ = ["mutate"]

_MOST_BYTES = 300_000
"""Of one part: a little more than any header may have."""


def mutate(rng: Random, parts: Parts, corpus: Sequence[Parts]) -> Parts:
    """Give a message with one to four things changed; `parts` stays as it is."""
    parts = list(parts)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
        if rng.random() < 0.7:
            parts[:1] = [_header(rng, parts[0] if parts else b"", corpus)]
        else:
            rng.choice(_OF_PARTS)(rng, parts, corpus)
    return [part[:_MOST_BYTES] for part in parts]


def _header(rng: Random, header: bytes, corpus: Sequence[Parts]) -> bytes:
    """Change one place in the tree of a header, or its bytes where it is no JSON any more."""
    try:
        tree = json.loads(header)
    except (ValueError, RecursionError):
        return _bytes(rng, header)
    if not isinstance(tree, dict | list) or not tree or rng.random() < 0.1:
        return _bytes(rng, header)
    try:
        raw = rng.choice(_OF_TREES)(rng, tree, corpus)
        text = json.dumps(tree, separators=(",", ":"), ensure_ascii=rng.random() < 0.5)
        return text.encode("utf-8", "surrogatepass").replace(RAW, raw)
    except (RecursionError, ValueError):
        return _bytes(rng, header)


def _place(rng: Random, tree: Any) -> tuple[Any, Any]:
    """Choose a value in a tree: what holds it, and its key there."""
    while True:
        key = rng.choice(list(tree) if isinstance(tree, dict) else range(len(tree)))
        below = tree[key]
        if not isinstance(below, dict | list) or not below or rng.random() < 0.2:
            return tree, key
        tree = below


def _another_value(rng: Random, tree: Any, corpus: Sequence[Parts]) -> bytes:
    holder, key = _place(rng, tree)
    holder[key], raw = values(rng, holder[key])
    return raw


def _from_another(rng: Random, tree: Any, corpus: Sequence[Parts]) -> bytes:
    other = json.loads(rng.choice(corpus)[0])
    holder, key = _place(rng, other)
    if isinstance(tree, dict):
        tree[str(key)] = holder[key]
    else:
        tree.append(holder[key])
    return b""


def _another_kind(rng: Random, tree: Any, corpus: Sequence[Parts]) -> bytes:
    if isinstance(tree, dict):
        tree["kind"] = json.loads(rng.choice(corpus)[0])["kind"]
    return b""


def _without(rng: Random, tree: Any, corpus: Sequence[Parts]) -> bytes:
    holder, key = _place(rng, tree)
    del holder[key]
    return b""


def _repeated(rng: Random, tree: Any, corpus: Sequence[Parts]) -> bytes:
    holder, key = _place(rng, tree)
    size = len(json.dumps(holder[key])) + 1
    count = min(rng.choice((2, 3, 20, 2000)), _MOST_BYTES // size)
    if isinstance(holder, list):
        holder[key:key] = [holder[key]] * count
    else:
        holder.update({f"{key}{number}": holder[key] for number in range(count)})
    return b""


def _twice_the_key(rng: Random, tree: Any, corpus: Sequence[Parts]) -> bytes:
    holder, key = _place(rng, tree)
    if isinstance(key, str):
        before = json.dumps(holder[key])
        holder[key], raw = values(rng, holder[key])
        if not raw:
            raw = json.dumps(holder[key]).encode()
        holder[key] = RAW[1:-1].decode()
        return raw + b"," + json.dumps(key).encode() + b":" + before.encode()
    return b""


def _another_size(rng: Random, tree: Any, corpus: Sequence[Parts]) -> bytes:
    """Claim other sizes throughout, as if the header were consistent."""
    size = rng.choice((0, 1, 7, 640, 16384, 16385, 2**24, 2**31, 2**63))
    face, frame = (tree.get(name) if isinstance(tree, dict) else None for name in ("face", "frame"))
    if isinstance(face, dict):
        face[rng.choice(("initial_points", "dense_points"))] = size
        face.pop("arrays", None)
    if isinstance(frame, dict) and isinstance(frame.get("calibration"), dict):
        frame["calibration"][rng.choice(("depth", "color"))] = {
            "width": size, "height": rng.choice((1, size)), "fx": 1.0 * size,
            "fy": 1.0 * size, "cx": 0.0, "cy": 0.0}
        frame.pop("arrays", None)
    return b""


def _flip(rng: Random, part: bytearray) -> None:
    for _ in range(rng.choice((1, 1, 2, 8))):
        part[rng.randrange(len(part))] = rng.randrange(256)


def _cut(rng: Random, part: bytearray) -> None:
    start = rng.randrange(len(part))
    del part[start:start + rng.choice((1, 4, len(part)))]


def _insert(rng: Random, part: bytearray) -> None:
    at = rng.randrange(len(part))
    part[at:at] = rng.choice((b"\0", b"\xff\xfe", b"{", b"[", b'"', b"\\u", b",", rng.randbytes(9)))


def _copy(rng: Random, part: bytearray) -> None:
    start = rng.randrange(len(part))
    piece = part[start:start + rng.randrange(1, 60)]
    part[start:start] = piece * rng.choice((1, 1, 3, 1000))


_OF_BYTES: tuple[Callable[[Random, bytearray], None], ...] = (_flip, _cut, _insert, _copy)


def _bytes(rng: Random, part: bytes) -> bytes:
    changed = bytearray(part or b"{}")
    rng.choice(_OF_BYTES)(rng, changed)
    return bytes(changed)


def _one_part(rng: Random, parts: Parts, corpus: Sequence[Parts]) -> None:
    if parts:
        index = rng.randrange(len(parts))
        parts[index] = _bytes(rng, parts[index])


def _drop(rng: Random, parts: Parts, corpus: Sequence[Parts]) -> None:
    if parts:
        del parts[rng.randrange(len(parts))]


def _again(rng: Random, parts: Parts, corpus: Sequence[Parts]) -> None:
    if parts:
        parts[0:0] = [rng.choice(parts)] * rng.choice((1, 2, 20))


def _swap(rng: Random, parts: Parts, corpus: Sequence[Parts]) -> None:
    rng.shuffle(parts)


def _graft(rng: Random, parts: Parts, corpus: Sequence[Parts]) -> None:
    parts[1:] = rng.choice(corpus)[1:]


def _resize(rng: Random, parts: Parts, corpus: Sequence[Parts]) -> None:
    if len(parts) > 1:
        index = rng.randrange(1, len(parts))
        size = len(parts[index])
        parts[index] = (parts[index] + bytes(size))[:rng.choice((0, size - 1, size + 1, 2 * size))]


_OF_TREES = (_another_value, _another_value, _another_value, _from_another, _another_kind,
             _without, _repeated, _twice_the_key, _another_size)
_OF_PARTS = (_one_part, _one_part, _drop, _again, _swap, _graft, _resize)
