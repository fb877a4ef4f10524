"""The decoders against broken input: the quick part of `script/fuzz`."""

import hashlib
import json
import struct
import tracemalloc
from pathlib import Path
from random import Random

import pytest

from denseface.service.errors import (
    CorruptFileError,
    KeyFileError,
    ProtocolError,
    RemoteProtocolError,
)
from denseface.service.protocol import messages
from denseface.service.protocol.wire import decode_from_hub, decode_to_hub
from denseface.service.security import new_pair, read_pair, read_public
from denseface.service.storage._record_file import read_parts
from tests.fuzzing.corpus import encoded, pack, packets, unpack
from tests.fuzzing.mutate import mutate
from tests.fuzzing.targets import Cost, UnexpectedError, check

CORPUS = encoded()
BY_KIND = {json.loads(parts[0])["kind"]: parts for parts in CORPUS}


def test_the_corpus_has_every_kind():
    assert {type(packet.message) for packet in packets()} == {
        *messages.TO_HUB, *messages.FROM_HUB}


@pytest.mark.parametrize("seed", range(4))
def test_no_input_raises_anything_but_a_protocol_error(seed):
    rng, cost = Random(seed), Cost()
    for _ in range(4000):
        cost.run(mutate(rng, rng.choice(CORPUS), CORPUS))
    # Neither all refused, which would test the JSON parser alone, nor all taken.
    assert 0.05 < cost.messages / cost.inputs < 0.5
    assert cost.grown_bytes < 64 * 2**20


def test_bytes_for_the_fuzzer_are_parts_again():
    for parts in [*CORPUS, [b""], [b"a", b""]]:
        assert unpack(pack(parts)) == parts
    assert unpack(b"") == [b""]
    assert unpack(b"\xff123") == [b"\xff123"]


def test_the_fuzzer_sees_a_decoder_that_raises(monkeypatch):
    def broken(parts):
        raise KeyError("kind")

    with pytest.raises(KeyError):
        check(broken, CORPUS[0])

    def multiline(parts):
        raise RemoteProtocolError("a\nb")

    with pytest.raises(UnexpectedError, match="not one short line"):
        check(multiline, CORPUS[0])


def report(**changes) -> list[bytes]:
    header, *arrays = BY_KIND["result"]
    tree = json.loads(header)
    tree["face"]["report"] |= changes
    return [json.dumps(tree, separators=(",", ":")).encode(), *arrays]


LETTERS = b'{"kind":"dead_letters","version":2,"request":1,"letters":[' + b"0," * 100_000 + b"0]}"
CROWD = BY_KIND["status"][0].replace(b'"sensors":[]', b'"sensors":[' + b"0," * 100_000 + b"0]")


# Found by the fuzzer or by its author: 250 kB took 1.1 s and 400 MB, for every wrong element was
# described before the first was named.
@pytest.mark.parametrize(("decode", "parts", "words"), [
    (decode_to_hub, report(candidates=[{}] * 84_000), "header has 253"),
    (decode_to_hub, report(candidates=[{}] * 20_000), "candidates.0.box: Field required"),
    (decode_to_hub, report(warnings=[0] * 30_000), "warnings.0: expected a text"),
    (decode_to_hub, report(timings_ms={f"{n:x}": "" for n in range(6_000)}), "timings_ms.0"),
    (decode_from_hub, [LETTERS], "letters.0"),
    (decode_from_hub, [CROWD], "sensors.0"),
    (decode_from_hub, [b'{"kind":"announce","version":2,'
                       + b",".join(b'"%x":0' % n for n in range(28_000)) + b"}"], "no such field"),
])
def test_a_header_of_many_faults_is_refused_by_the_first(decode, parts, words):
    tracemalloc.start()
    try:
        with pytest.raises(RemoteProtocolError, match=words):
            decode(parts)
        assert tracemalloc.get_traced_memory()[1] < 32 * 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("size", [2**24, 2**24 - 1, 16384])
def test_nothing_is_allocated_for_a_claim(size):
    header, *arrays = BY_KIND["result"]
    tree = json.loads(header)
    del tree["face"]["arrays"]
    tree["face"] |= {"initial_points": size, "dense_points": size}
    tracemalloc.start()
    try:
        with pytest.raises(ProtocolError, match="bytes"):
            decode_to_hub([json.dumps(tree).encode(), *arrays])
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(("kind", "shown"), [
    ("\x1b[2J", r"'\\x1b\[2J'"), ("a\nb", r"'a\\nb'"), ("\u202e", r"'\\u202e'")])
def test_a_refusal_cannot_forge_a_log_line(kind, shown):
    with pytest.raises(RemoteProtocolError, match=shown):
        decode_to_hub([json.dumps({"kind": kind, "version": 2}).encode()])


def test_what_grows_when_written_again_is_kept_and_passed_on():
    box = {"box": [0, 0, 0, 0], "depth_mm": 0, "width_mm": 0, "verdict": ""}
    parts = report(candidates=[box] * 950)
    parts[0] = parts[0].replace(b'_mm":0,', b'_mm":1e15,')
    assert 60_000 < len(parts[0]) < 2**16
    assert check(decode_to_hub, parts)


def record_file(path: Path, body: bytes) -> Path:
    path.write_bytes(b"denseface spool 3\n" + hashlib.sha256(body).digest() + body)
    return path


@pytest.mark.parametrize("body", [
    b"", b"\1", struct.pack("<I", 2**32 - 1), struct.pack("<IQ", 1, 5) + b"four",
    struct.pack("<IQ", 1, 3) + b"four", struct.pack("<IQQ", 2, 2**64 - 1, 5) + b"four"])
def test_a_file_with_a_wrong_index_is_corrupt(tmp_path, body):
    path = record_file(tmp_path / "x.frame", body)
    with pytest.raises(CorruptFileError, match=r"x\.frame: contents"):
        read_parts(path)


def test_a_broken_key_file_is_named(tmp_path):
    secret, _ = new_pair(tmp_path, "me")
    whole, rng = secret.read_bytes(), Random(0)
    path, said = tmp_path / "broken", []
    path.touch(mode=0o600)
    for _ in range(300):
        path.write_bytes((mutate(rng, [whole], CORPUS) or [b""])[0])
        for read in (read_pair, read_public):
            try:
                read(path)
            except KeyFileError as error:
                said.append(str(error))
    assert len(said) > 300
    assert all("broken" in one and one.isprintable() for one in said)


@pytest.mark.parametrize("half", ["public_key", "secret_key"])
def test_z85_that_is_no_key_is_refused(tmp_path, half):
    secret, _ = new_pair(tmp_path, "me")
    secret.write_text(json.dumps(json.loads(secret.read_text()) | {half: "#" * 40}))
    with pytest.raises(KeyFileError, match=r"me\.secret: its"):
        read_pair(secret)
    with pytest.raises(KeyFileError):
        read_public("#" * 40)


def test_a_file_larger_than_any_message_is_not_read_whole(tmp_path, monkeypatch):
    monkeypatch.setattr("denseface.service.storage._record_file._MAX_BYTES", 1000)
    with pytest.raises(CorruptFileError, match="more than 1000 bytes"):
        read_parts(record_file(tmp_path / "x", bytes(1000)))
