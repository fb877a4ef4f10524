"""docs/vectors is what the code writes, and what it reads; `script/vectors` makes it anew."""

import json
import zlib

import jsonschema
import numpy as np
import pytest

from denseface.service.protocol import messages
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import decode_from_hub, decode_to_hub
from tests.face_grid_reader import read_face_grid
from tests.wire_vectors import FOLDER, face, files, vectors

MADE = dict(files())
VECTORS = {one.name: one for one in vectors()}
KINDS = {kind.model_fields["kind"].default for kind in (*messages.TO_HUB, *messages.FROM_HUB)}
SCHEMA = json.loads((FOLDER / "schema.json").read_text())


def parts_of(name):
    """Cut a file into its parts as docs/wire.md says: the topic, the header, the arrays."""
    said = json.loads((FOLDER / f"{name}.json").read_text())
    data, parts = (FOLDER / f"{name}.bin").read_bytes(), []
    for size in said["parts"]:
        parts.append(data[:size])
        data = data[size:]
    assert data == b""
    topic = parts.pop(0).decode() if said["topic"] else None
    assert topic == said["topic"]
    return said, parts


def test_the_files_are_those_that_the_code_writes():
    assert sorted(path.name for path in FOLDER.iterdir()) == sorted(MADE)
    stale = [name for name, content in MADE.items()
             if name != "face_grid.bin" and (FOLDER / name).read_bytes() != content]
    assert not stale, "script/vectors writes them anew; a reader of the old ones must not break"


def test_the_grid_is_the_one_that_the_code_writes():
    """Unpacked: two releases of zlib may pack it otherwise."""
    written, made = (FOLDER / "face_grid.bin").read_bytes(), MADE["face_grid.bin"]
    start = 12 + int.from_bytes(made[8:12], "little")
    assert written[:start] == made[:start]
    assert zlib.decompress(written[start:]) == zlib.decompress(made[start:])


def test_the_grid_is_the_face_of_the_messages():
    read, dense = read_face_grid((FOLDER / "face_grid.bin").read_bytes()), face().dense
    assert np.array_equal(read.cells, dense.cells)
    assert np.abs(read.points - dense.points).max() <= 0.005 + 1e-4
    assert np.array_equal(read.colors, dense.colors)


def test_there_is_one_of_every_kind_and_of_every_topic():
    assert {name.partition(".")[0] for name in VECTORS} == KINDS
    assert {one.topic for one in VECTORS.values()} == {"", *Topic}


@pytest.mark.parametrize("name", VECTORS)
def test_a_vector_is_read_as_what_it_says(name):
    said, parts = parts_of(name)
    packet = (decode_from_hub if said["from"] == "hub" else decode_to_hub)(parts)
    assert packet.message == VECTORS[name].packet.message
    assert {key: array.tolist() for key, array in packet.arrays.items()} == said["arrays"]
    assert json.loads(parts[0]) == said["header"]


def fits(header):
    """Say whether a header is as the schema of its kind says; all kinds are in `oneOf`."""
    kind = SCHEMA["discriminator"]["mapping"][header["kind"]]
    assert {"$ref": kind} in SCHEMA["oneOf"]
    schema = {"$ref": kind, "$defs": SCHEMA["$defs"]}
    return jsonschema.Draft202012Validator(schema).is_valid(header)


def test_all_vectors_are_as_the_schema_says_and_what_the_code_refuses_is_not():
    headers = {name: parts_of(name)[0]["header"] for name in VECTORS}
    assert [name for name, header in headers.items() if not fits(header)] == []
    for wrong in ({"frames": 99}, {"capture_id": "a/b"}, {"mood": "fine"}, {"version": 3}):
        assert not fits(headers["press"] | wrong)


@pytest.mark.parametrize("name", ["face_done", "face_done.answer"])
def test_a_face_is_decoded_as_it_says(name):
    said, parts = parts_of(name)
    packet = decode_from_hub(parts)
    read, decoded = packet.message.face.join(packet.arrays), said["decoded"]
    for cloud, expected in ((read.initial, decoded["initial"]), (read.dense, decoded["dense"])):
        for array, values in expected.items():
            assert getattr(cloud, array).tolist() == values, array
    assert np.abs(read.dense.normals - face().dense.normals).max() < 1e-4
