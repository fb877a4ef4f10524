"""Pictures and videos: their size, and the texts that say where the face comes from."""

import os
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO
from xml.parsers.expat import ExpatError, ParserCreate

from denseface.files import open_regular
from denseface.service.tools.info.inspection import Info
from denseface.service.tools.info.models import printable, refuse_document_type

__all__ = ["of_mp4", "of_png", "of_webp"]

_MAX_PARTS = 100_000
_MAX_TEXT = 1 << 20
_NAMESPACE = "urn:denseface:provenance "
_XMP_BOX = bytes.fromhex("BE7ACFCB97A942E89C71999491E3AFAC")


def of_png(path: Path) -> Info:
    """Look into a `.png`."""
    told: dict[str, str] = {}
    with open_regular(path) as file:
        width, height = struct.unpack(">II", file.read(24)[16:])
        for kind, size in _parts(file, 8, ">I4s", after=4):
            if kind == b"iTXt" and size <= _MAX_TEXT:
                name, _, text = file.read(size).partition(b"\0")
                if text[:4] == bytes(4):  # not compressed, of no language
                    told[name.decode("latin-1")] = printable(text[4:].decode("utf-8", "replace"))
            if kind == b"IDAT":
                break
    return {"kind": "picture", "format": "PNG", "pixels": f"{width}x{height}", "provenance": told}


def of_webp(path: Path) -> Info:
    """Look into a `.webp`."""
    found: Info = {"kind": "picture", "format": "WebP"}
    frames, milliseconds, packet = 0, 0, b""
    with open_regular(path) as file:
        for kind, size in _parts(file, 12, "<4sI", even=True):
            if kind == b"VP8X":
                body = file.read(10)
                found["pixels"] = "{}x{}".format(*(
                    int.from_bytes(body[at:at + 3], "little") + 1 for at in (4, 7)))
            elif kind == b"ANMF":
                frames += 1
                milliseconds += int.from_bytes(file.read(15)[12:], "little")
            elif kind == b"XMP " and size <= _MAX_TEXT:
                packet = file.read(size)
    if frames > 1:
        found |= {"kind": "animated picture", "frames": frames, "seconds": milliseconds / 1000}
    return found | {"provenance": _of_xmp(packet)}


def of_mp4(path: Path) -> Info:
    """Look into an `.mp4`: its boxes of the outermost level."""
    packet, kinds = b"", set()
    with open_regular(path) as file:
        for kind, size in _parts(file, 0, ">I4s", of_all=True):
            kinds.add(kind)
            if kind == b"uuid" and size <= _MAX_TEXT:
                body = file.read(size)
                if body.startswith(_XMP_BOX):
                    packet = body[len(_XMP_BOX):]
    if b"moov" not in kinds:
        raise ValueError("cut short: it has no table of its frames, moov")
    return {"kind": "video", "format": "MP4", "provenance": _of_xmp(packet)}


def _parts(
    file: BinaryIO, start: int, head: str, *, after: int = 0, even: bool = False,
    of_all: bool = False,
) -> Iterator[tuple[bytes, int]]:
    """Give kind and size of each part of a file, from `start` on; the file is then at its body.

    Parameters
    ----------
    head : of a part, kind and size in either order
    after : bytes behind its body that the size leaves out
    even : whether each part begins at an even place
    of_all : whether the size is that of the head, too; 1 is then followed by the size in 64 bits,
        0 reaches to the end

    Raises
    ------
    ValueError
        There are too many, or one is cut short.
    """
    end = file.seek(0, os.SEEK_END)
    at = start
    for _ in range(_MAX_PARTS):
        if at == end:
            return
        file.seek(at)
        bytes_of_head = file.read(8)
        if len(bytes_of_head) < 8:
            break
        one, other = struct.unpack(head, bytes_of_head)
        kind, size = (one, other) if isinstance(one, bytes) else (other, one)
        body = at + 8
        if of_all:
            if size == 1:
                size, body = int.from_bytes(file.read(8), "big"), body + 8
            size = (at + size if size else end) - body
        at = body + size + after
        if even:
            at += at % 2
        if size < 0 or at > end:
            break
        yield kind, size
    raise ValueError("cut short, or parts of it lie over each other")


def _of_xmp(packet: bytes) -> dict[str, str]:
    """Give what an XMP packet of ours says; nothing where there is none, or it is damaged."""
    found: dict[str, str] = {}

    def begin(_: str, given: dict[str, str]) -> None:
        for name, text in given.items():
            if name.startswith(_NAMESPACE):
                found[name.removeprefix(_NAMESPACE)] = printable(text)

    parser = ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = begin
    parser.StartDoctypeDeclHandler = refuse_document_type
    with suppress(ExpatError, ValueError):
        parser.Parse(packet.strip(b"\0"), True)
    return found
