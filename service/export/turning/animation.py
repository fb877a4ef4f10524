"""A face that turns, as `.webp` (an animated picture) and as `.mp4` (a video)."""

import errno
import os
import struct
import tempfile
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import cv2

from denseface.recon.face import Face
from denseface.service.errors import FormatError
from denseface.service.export.provenance import provenance
from denseface.service.export.turning.views import FRAMES_PER_S, HEIGHT, WIDTH, turned

__all__ = ["to_mp4", "to_webp"]

_QUALITY = 98
"""Of WebP: what changes little from frame to frame is left as it was, and below this that shows as
blocks; a loop has 1.5 to 2 MB."""
_CODECS = ("avc1", "vp09", "mp4v")
"""In the order in which they are tried: what every browser plays, what most do, what players do."""
_XMP = 0x04
"""Flag of a WebP's header: there is such a chunk."""
_XMP_BOX = bytes.fromhex("BE7ACFCB97A942E89C71999491E3AFAC")
"""Type of an MP4's box that holds XMP (XMP specification, part 3, 1.1.7)."""


def to_webp(face: Face) -> bytes:
    """Give the bytes of an animated `.webp` file, which begins anew without a jump."""
    animation: Any = cv2.Animation()
    animation.frames = [cv2.cvtColor(frame, cv2.COLOR_RGB2BGR) for frame in turned(face.dense)]
    animation.durations = [round(1000 / FRAMES_PER_S)] * len(animation.frames)
    animation.loop_count = 0
    encoded, data = cv2.imencodeanimation(
        ".webp", animation, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
    if not encoded:
        raise RuntimeError("OpenCV could not write the WebP")
    return _with_xmp(data.tobytes(), face)


def _with_xmp(data: bytes, face: Face) -> bytes:
    """Add a chunk that tells of the face's making, and the flag that there is one."""
    packet = _xmp(face)
    chunk = b"XMP " + struct.pack("<I", len(packet)) + packet + b"\0" * (len(packet) % 2)
    if data[12:16] != b"VP8X":
        return data
    return (data[:4] + struct.pack("<I", len(data) + len(chunk) - 8) + data[8:20]
            + bytes([data[20] | _XMP]) + data[21:] + chunk)


def to_mp4(face: Face) -> bytes:
    """Give the bytes of an `.mp4` file with one loop.

    FormatError where the machine has no encoder.
    """
    # What a codec lacks here is not the user's concern, and libraries would tell it to stderr.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        with tempfile.TemporaryDirectory(prefix="denseface-") as folder:
            path = Path(folder, "face.mp4")
            _encode(face, path)
            data = path.read_bytes()
    finally:
        cv2.utils.logging.setLogLevel(level)
    # Its last box: a file that was cut short would have none.
    if b"moov" not in data:
        raise OSError(errno.EIO, "The video could not be written whole", tempfile.gettempdir())
    packet = _xmp(face)
    return data + struct.pack(">I4s", 24 + len(packet), b"uuid") + _XMP_BOX + packet


def _encode(face: Face, path: Path) -> None:
    for codec in _CODECS:
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec),
                                 FRAMES_PER_S, (WIDTH, HEIGHT))
        if writer.isOpened():
            for frame in turned(face.dense):
                writer.write(cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
            writer.release()
            return
    raise FormatError(f".mp4: OpenCV {cv2.__version__} finds no encoder for video on this "
                      "machine; .webp holds the same and needs none")


def _xmp(face: Face) -> bytes:
    """Give what is known of the face's making as an XMP packet (ISO 16684-1)."""
    told = "".join(f"\n  d:{name}={quoteattr(_printable(text))}"
                   for name, text in provenance(face.report).items())
    return (f"""\
<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/">
<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
 <rdf:Description rdf:about="" xmlns:d="urn:denseface:provenance"{told}/>
</rdf:RDF>
</x:xmpmeta>
<?xpacket end="r"?>""").encode()


def _printable(text: str) -> str:
    """Leave out what XML does not allow."""
    return "".join(one if one.isprintable() else " " for one in text)
