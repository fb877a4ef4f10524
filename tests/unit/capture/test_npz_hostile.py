"""Frame files made to hurt: one named error each, and no more memory than the file may claim."""

import io
import struct
import tracemalloc
import zipfile
import zlib
from pathlib import Path
from random import Random

import numpy as np
import pytest

from denseface.capture.errors import CalibrationError, FrameError, UnreadableSourceError
from denseface.capture.npz import load_frame
from tests.unit.capture.test_npz import H, W, write

NAMED = (UnreadableSourceError, FrameError, CalibrationError)


def read(path: Path, most_bytes: int = 2**20) -> Exception | None:
    """Read a file, give the error, and see to it that memory stays below a bound."""
    tracemalloc.start()
    try:
        load_frame(path)
        found = None
    except NAMED as error:
        found = error
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < most_bytes
    if found:
        assert "\n" not in str(found)
        assert path.name in str(found)
    return found


def entries(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(path: Path, members: list[tuple[str, bytes]]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return path


def array(shape: tuple[int, ...], descr: str, data: bytes = b"") -> bytes:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": descr, "fortran_order": False, "shape": shape})
    return header.getvalue() + data


# A zip that is broken in places that only a writer of zips knows.

def _mutated(rng: Random, content: bytearray) -> bytes:
    places = [at for signature in (b"PK\1\2", b"PK\3\4", b"PK\5\6")
              for at in range(len(content)) if content.startswith(signature, at)]
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.choice(places) + rng.randrange(46) if rng.random() < 0.7 else rng.randrange(
            len(content))
        at = min(at, len(content) - 4)
        match rng.randrange(4):
            case 0:
                content[at] = rng.randrange(256)
            case 1:
                content[at:at + 2] = struct.pack("<H", rng.choice((0, 1, 8, 9, 12, 14, 65535)))
            case 2:
                content[at:at + 4] = struct.pack("<I", rng.choice((0, 1, 2**31, 2**32 - 1)))
            case 3:
                del content[at:at + rng.choice((1, 4, 100))]
    return bytes(content)


def test_a_zip_with_wrong_fields_is_a_named_error(tmp_path):
    rng, whole = Random(0), write(tmp_path / "w.npz").read_bytes()
    path, refused = tmp_path / "m.npz", 0
    for _ in range(600):
        path.write_bytes(_mutated(rng, bytearray(whole)))
        refused += read(path) is not None
    assert refused > 100


def test_an_array_header_with_wrong_fields_is_a_named_error(tmp_path):
    rng = Random(0)
    good = entries(write(tmp_path / "w.npz"))
    path, refused = tmp_path / "m.npz", 0
    for _ in range(400):
        name = rng.choice(list(good))
        content = bytearray(good[name])
        for _ in range(rng.choice((1, 1, 3))):
            at = rng.randrange(min(len(content), 128))
            content[at:at + rng.choice((0, 1, 1, 5))] = rng.choice(
                (b"9", b"(", b")", b"'", b"-", b"|O", b"\0", b"\xff", b"{" * 50, b"(" * 3000,
                 b"1" * 3000, b"0" * 9, bytes([rng.randrange(256)])))
        zipped(path, [(one, bytes(content) if one == name else good[one]) for one in good])
        refused += read(path, 16 * 2**20) is not None
    assert refused > 100


# Bombs.

def test_a_member_that_inflates_without_end_is_not_followed(tmp_path):
    """It claims a small array and holds 64 MiB of zeros in 64 kB."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    head = array((H, W), "<u2")
    packed = packer.compress(head) + b"".join(
        packer.compress(bytes(2**20)) for _ in range(64)) + packer.flush()
    path = tmp_path / "bomb.npz"
    size = len(head) + 2**26
    name = b"depth.npy"
    local = struct.pack("<4s5H3I2H", b"PK\3\4", 20, 0, 8, 0, 0, 0, len(packed), size, len(name), 0)
    central = struct.pack("<4s6H3I5H2I", b"PK\1\2", 20, 20, 0, 8, 0, 0, 0, len(packed), size,
                          len(name), 0, 0, 0, 0, 0, 0)
    end = struct.pack("<4s4H2IH", b"PK\5\6", 0, 0, 1, 1, len(central) + len(name),
                      len(local) + len(name) + len(packed), 0)
    path.write_bytes(local + name + packed + central + name + end)
    error = read(path, 4 * 2**20)
    assert isinstance(error, UnreadableSourceError)
    assert "needs 96 bytes, the file holds more" in str(error)


@pytest.mark.parametrize(("name", "shape", "descr"), [
    ("depth", (16384, 8192), "<u2"), ("color", (5000, 16384, 3), "|u1")])
def test_an_array_is_allocated_no_faster_than_the_file_gives_it(tmp_path, name, shape, descr):
    """These sizes are allowed; the data is not there."""
    good = entries(write(tmp_path / "w.npz"))
    good[f"{name}.npy"] = array(shape, descr, bytes(1000))
    error = read(zipped(tmp_path / "c.npz", list(good.items())))
    assert isinstance(error, UnreadableSourceError)
    assert "the file holds fewer" in str(error)


def test_the_same_data_for_all_members_counts_for_each(tmp_path):
    """Members that overlap, the trick of the best bombs, are limited each by its own header."""
    path = zipped(tmp_path / "o.npz", [(f"{name}.npy", array((H, W), "<u2", bytes(2 * H * W)))
                                       for name in ("depth", "color")])
    content = bytearray(path.read_bytes())
    second = content.index(b"PK\1\2", content.index(b"PK\1\2") + 1)
    content[second + 42:second + 46] = struct.pack("<I", 0)  # where its local header is
    path.write_bytes(content)
    assert isinstance(read(path), UnreadableSourceError)


def test_more_entries_than_there_are_keys_are_refused_at_the_first(tmp_path):
    path = zipped(tmp_path / "n.npz", [(f"{n}.npy", b"") for n in range(1000)])
    assert "unexpected entry '0.npy'" in str(read(path))


def test_a_list_of_members_without_end_is_not_read(tmp_path):
    """Each of its entries would take a hundred times its bytes."""
    path = zipped(tmp_path / "n.npz", [(f"{n}.npy", b"") for n in range(5000)])
    assert "list of members has" in str(read(path))


@pytest.mark.parametrize(("shape", "size"), [
    ("(True, 8)", 16), ("(6, True)", 12), ("(True, True)", 2), ("(6, 8.0)", 96), ("(6, '8')", 96),
    ("[6, 8]", 96), ("48", 96), ("(6, -8)", 96), ("(6, None)", 96), ("((6, 8),)", 96)])
def test_a_shape_that_is_no_shape_is_named(tmp_path, shape, size):
    """To Python, True is the integer 1, and NumPy's reader takes it for one."""
    good = entries(write(tmp_path / "w.npz"))
    text = f"{{'descr': '<u2', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    good["depth.npy"] = b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text + bytes(size)
    assert isinstance(read(zipped(tmp_path / "s.npz", list(good.items()))),
                      UnreadableSourceError | FrameError)


@pytest.mark.parametrize("name", [
    "depth.npy", "../depth.npy", "/depth.npy", "depth.npy/", "DEPTH.NPY", "depth", "a\x1b[2Jb.npy",
    "a\nb.npy"])
def test_names_are_the_keys_and_each_stands_once(tmp_path, name):
    good = entries(write(tmp_path / "w.npz"))
    with pytest.warns(UserWarning, match="Duplicate") if name == "depth.npy" else _nothing():
        path = zipped(tmp_path / "d.npz", [*good.items(), (name, good["depth.npy"])])
    error = read(path)
    assert isinstance(error, FrameError)
    assert "unexpected entry" in str(error)
    assert str(error).isprintable()


def _nothing():
    return pytest.MonkeyPatch.context()


@pytest.mark.parametrize("descr", ["|O", ">u2", "<i2", "<f8", "<c16", "<M8[us]", "|V2", "|S2"])
def test_other_kinds_of_number_are_refused(tmp_path, descr):
    good = entries(write(tmp_path / "w.npz"))
    good["depth.npy"] = array((H, W), descr, bytes(16 * H * W))
    assert isinstance(read(zipped(tmp_path / "k.npz", list(good.items()))), NAMED)


def test_a_structured_array_is_refused(tmp_path):
    good = entries(write(tmp_path / "w.npz"))
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {
        "descr": [("a", "<u2"), ("b", "|O")], "fortran_order": False, "shape": (H, W)})
    good["depth.npy"] = header.getvalue() + bytes(999)
    assert "expected uint16" in str(read(zipped(tmp_path / "s.npz", list(good.items()))))


def test_an_encrypted_member_is_named(tmp_path):
    path = write(tmp_path / "e.npz")
    content = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        content[content.index(signature) + offset] |= 1
    path.write_bytes(content)
    error = read(path)
    assert isinstance(error, UnreadableSourceError)
    assert "encrypted" in str(error)
