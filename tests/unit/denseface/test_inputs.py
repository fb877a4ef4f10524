"""Whatever the name of an input leads to: one named error, at once, and no memory taken for it."""

import os
import tracemalloc

import pytest

from denseface import load_face, open_source
from denseface.capture.calibration_files import read_calibration
from denseface.capture.errors import CaptureError
from denseface.capture.image_pair import FolderSource, read_color_image, read_depth_image
from denseface.capture.oni.file import read_oni
from denseface.service.errors import ServiceError
from denseface.service.protocol.roles import Role
from denseface.service.security import AllowList, KeyPair, allow, read_pair, read_public
from denseface.service.storage import FolderStore
from denseface.service.storage._record_file import read_parts

_MOST_BYTES = 4 * 2**20
_SPARSE_BYTES = 2**42


def calibration_beside(path):
    recording = path.with_name("recording.npz")
    recording.write_bytes(b"")
    path.rename(path.with_name("recording.calibration.json"))
    open_source(recording)


def list_of_a_folder(path):
    for name in ("depth", "rgb"):
        (path.parent / name).mkdir()
    (path.parent / "rgb.txt").write_text("# timestamp filename\n")
    FolderSource(path.parent)


READERS = {
    "input.npz": open_source,
    "input.oni": open_source,
    "records.oni": read_oni,
    "face.npz": load_face,
    "calibration.json": read_calibration,
    "beside.json": calibration_beside,
    "depth.png": read_depth_image,
    "depth.npy": read_depth_image,
    "color.jpg": read_color_image,
    "depth.txt": list_of_a_folder,
    "hub.secret": read_pair,
    "hub.public": read_public,
    "a.frame": read_parts,
}


def nothing(path):
    path.write_bytes(b"")


def unreadable(path):
    path.write_bytes(b"{}")
    path.chmod(0)


def sparse(path):
    with path.open("wb") as file:
        file.truncate(_SPARSE_BYTES)


KINDS = {
    "pipe": os.mkfifo,
    "folder": os.mkdir,
    "zeros": lambda path: path.symlink_to("/dev/zero"),
    "terminal": lambda path: path.symlink_to("/dev/ptmx"),
    "loop": lambda path: path.symlink_to(path),
    "nothing": nothing,
    "sparse": sparse,
    "unreadable": unreadable,
}


@pytest.fixture(scope="module")
def _imported(tmp_path_factory):
    """What the first recording imports is no memory of a reader's."""
    path = tmp_path_factory.mktemp("first") / "empty.oni"
    nothing(path)
    with pytest.raises(CaptureError):
        open_source(path)


@pytest.mark.usefixtures("_imported")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", READERS)
def test_what_is_no_input_is_named_at_once(tmp_path, name, kind):
    path = tmp_path / name
    KINDS[kind](path)
    tracemalloc.start()
    try:
        with pytest.raises((CaptureError, ServiceError)) as caught:
            READERS[name](path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < _MOST_BYTES
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_key_keeps_nobody_else_out(tmp_path, kind):
    allow(tmp_path / "keys", "good", KeyPair.generate().public, frozenset({Role.WORKER}))
    KINDS[kind](tmp_path / "keys" / "allowed" / "bad")
    assert [one.name for one in AllowList(tmp_path / "keys")] == ["good"]


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_frame_does_not_keep_the_hub_from_starting(tmp_path, kind):
    with FolderStore(tmp_path / "data"):
        pass
    KINDS[kind](tmp_path / "data" / "frames" / "a.frame")
    KINDS[kind](tmp_path / "data" / "quarantine" / "b.json")
    with FolderStore(tmp_path / "data") as store:
        assert [letter.capture_id for letter in store.dead_letters(after=0, limit=9)] == ["a"]
