"""Frames and faces that version 1 kept: `kept_by_version_1` is its data folder, without database.

They are `small_frame()` and `small_face()`.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from denseface.service.errors import ProtocolError
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.wire import decode_from_hub, encode
from denseface.service.storage.folder_store import FolderStore
from denseface.service.storage.former import decode_former
from denseface.service.storage.record_file import read_parts
from denseface.service.storage.records import read_face
from tests.unit.service.faces import small_face, small_frame

KEPT = Path(__file__).with_name("kept_by_version_1")
FACE = KEPT / "faces" / "done.0f.face"


@pytest.fixture
def data(tmp_path):
    folder = tmp_path / "data"
    folder.mkdir(mode=0o700)
    for name in ("frames", "faces"):
        (folder / name).mkdir(mode=0o700)
        for path in (KEPT / name).iterdir():
            shutil.copy(path, folder / name)
    return folder


def test_a_face_that_version_1_kept_is_given_out_as_any_other(data):
    with FolderStore(data) as store:
        assert store.find("done").state is CaptureState.DONE
        packet = decode_from_hub(encode(store.outcome("done")))
    face, expected = packet.message.face.join(packet.arrays), small_face()
    assert packet.message.version == 2
    assert face.report == expected.report
    for name in ("points", "colors", "cells"):
        np.testing.assert_array_equal(getattr(face.dense, name), getattr(expected.dense, name))
    for name in ("points", "colors"):
        np.testing.assert_array_equal(getattr(face.initial, name), getattr(expected.initial, name))
    np.testing.assert_allclose(face.dense.normals, expected.dense.normals, atol=2e-5)
    np.testing.assert_allclose(face.dense.sigma, expected.dense.sigma, rtol=2**-11)


def test_a_frame_that_version_1_kept_waits_for_a_worker(data):
    with FolderStore(data) as store:
        assert store.unfinished() == ["waits"]
        kept = store.frame("waits")
        assert kept.checksum == store.find("waits").frame_sha256
    np.testing.assert_array_equal(kept.message.frame.join(kept.arrays).depth, small_frame().depth)


def test_its_checksum_stays_that_of_the_file():
    _, checksum = read_parts(FACE)
    assert read_face(FACE, checksum).checksum == checksum


def parts(**changes):
    _, header, *arrays = read_parts(FACE)[0]
    return [json.dumps(json.loads(bytes(header)) | changes).encode(), *map(bytes, arrays)]


def of_face(**changes):
    return parts(face=json.loads(parts()[0])["face"] | changes)


def damaged_points():
    one = parts()
    points = np.frombuffer(one[3], "<f4").copy()
    points[0] += 1
    return [*one[:3], points.tobytes(), *one[4:]]


@pytest.mark.parametrize(("found", "words"), [
    ([], "0 parts"),
    ([b"no json"], "malformed|Invalid JSON"),
    ([b"[" * 100_000], "recursion|Invalid JSON"),
    (parts(version=0), "version: Input should be 2"),
    (parts(version=3), "version: Input should be 2"),
    (parts(kind="press"), "capture_id|Extra inputs|request"),
    (parts(face=None), "result of version 1"),
    (parts(face={}), "result of version 1: Field required"),
    (parts(capture_id="../x"), "result of version 1: String should match pattern"),
    (parts()[:-1], "result of version 1: .*shorter"),
    ([*parts(), b""], "result of version 1: .*longer"),
    ([*parts()[:-1], parts()[-1][:-8]], "result of version 1: cannot reshape"),
    ([*parts()[:-1], parts()[-1][:-1]], "result of version 1: buffer size"),
    (of_face(dense_points=10**6), "result of version 1: cannot reshape"),
    (of_face(grid_shape=[3, 3]), "result of version 1: cells must lie"),
    (damaged_points(), "result of version 1: face: point 8 is not at its place"),
])
def test_what_is_not_as_version_1_wrote_it_is_a_protocol_error(found, words):
    with pytest.raises(ProtocolError, match=words):
        decode_former(found)
