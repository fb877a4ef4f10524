"""The Point Cloud Library's `.pcd`, version 0.7: binary and text."""

import numpy as np
from numpy.typing import NDArray

from denseface.service.export.reading.meshes import RawMesh

__all__ = ["from_pcd"]

_MAX_HEADER_BYTES = 1 << 16
_KINDS = {("F", 4): "<f4", ("F", 8): "<f8", **{
    (kind, size): f"<{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)}}


def from_pcd(data: bytes) -> RawMesh:
    """Read a file's bytes; ValueError says what is wrong with them."""
    header, body = _header(data)
    row = _row(header)
    (count,) = _numbers(header, "POINTS", 1)
    if header.get("DATA") == ["binary"]:
        if len(body) < count * row.itemsize:
            raise ValueError(f"cut short: {count} points announced")
        table = np.frombuffer(body, row, count)
    elif header.get("DATA") == ["ascii"]:
        table = _from_text(body, row, count)
    else:
        raise ValueError(f"DATA {' '.join(header.get('DATA', []))[:40]}, expected binary or ascii: "
                         "pcl_convert_pcd_ascii_binary or CloudCompare makes such a file")
    for name in "xyz":
        if name not in (row.names or ()) or row[name].shape:
            raise ValueError(f"has no field {name}")
    points = np.stack([table[name] for name in "xyz"], axis=1)
    finite = np.isfinite(points).all(axis=1)
    return RawMesh(points[finite], None, _colors(table[finite]))


def _header(data: bytes) -> tuple[dict[str, list[str]], bytes]:
    header: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in header:
        end = data.find(b"\n", at, _MAX_HEADER_BYTES)
        if end < 0:
            raise ValueError("no .pcd file: no line DATA in its header")
        name, *values = data[at:end].decode("ascii", "replace").split() or ["#"]
        if not name.startswith("#"):
            header[name] = values
        at = end + 1
    return header, data[at:]


def _numbers(header: dict[str, list[str]], name: str, count: int) -> list[int]:
    values = header.get(name, [])
    if len(values) != count or not all(one.isdecimal() and len(one) < 12 for one in values):
        raise ValueError(f"header: {name} {' '.join(values)[:40]}, expected {count} whole "
                         f"number{'s' * (count != 1)}")
    return list(map(int, values))


def _row(header: dict[str, list[str]]) -> np.dtype[np.void]:
    names = header.get("FIELDS", [])
    if not names:
        raise ValueError("header: no FIELDS")
    sizes = _numbers(header, "SIZE", len(names))
    counts = _numbers(header, "COUNT", len(names)) if "COUNT" in header else [1] * len(names)
    kinds = header.get("TYPE", [])
    if len(kinds) != len(names) or max(counts) > 4096:
        raise ValueError(f"header: TYPE or COUNT does not fit {len(names)} FIELDS")
    fields: list[tuple[str, str] | tuple[str, str, int]] = []
    for number, (name, kind, size, count) in enumerate(
            zip(names, kinds, sizes, counts, strict=True)):
        known = _KINDS.get((kind, size))
        if known is None:
            raise ValueError(f"header: field {name[:40]} of TYPE {kind[:8]} and SIZE {size}")
        # `_` is padding, and may be there more than once.
        name = f"padding {number}" if name == "_" else name
        fields.append((name, known) if count == 1 else (name, known, count))
    return np.dtype(fields)


def _from_text(body: bytes, row: np.dtype[np.void], count: int) -> NDArray[np.void]:
    names = row.names or ()
    if any(row[name].shape for name in names):
        raise ValueError("COUNT other than 1 in a file of text is not read")
    tokens = body.split()
    if len(tokens) < count * len(names):
        raise ValueError(f"cut short: {count} points announced")
    table = np.zeros(count, row)
    for column, name in enumerate(names):
        values = tokens[column:count * len(names):len(names)]
        with np.errstate(over="ignore", invalid="ignore"):
            table[name] = [int(value) if row[name].kind in "iu" else float(value)
                           for value in values]
    return table


def _colors(table: NDArray[np.void]) -> NDArray[np.uint8] | None:
    """Give the colours, which are packed into the bits of one number, 0xAARRGGBB."""
    for name in ("rgb", "rgba"):
        if (name in (table.dtype.names or ()) and table.dtype[name].itemsize == 4
                and not table.dtype[name].shape):
            packed = np.ascontiguousarray(table[name]).view("<u4")
            return np.stack([packed >> 16 & 255, packed >> 8 & 255, packed & 255],
                            axis=1).astype(np.uint8)
    return None
