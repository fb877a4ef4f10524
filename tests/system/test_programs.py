"""The programs in other languages read the test vectors, and end in one line where they must."""

import json
import subprocess
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zmq

from denseface.service.protocol.messages import FROM_HUB, TO_HUB
from denseface.service.transport.addresses import publications_of
from tests.ports import free_port
from tests.system.programs import LANGUAGES, NODE, Program, program
from tests.system.running import REPOSITORY, killed_at_the_end
from tests.waiting import LIMIT_MS, until

_VECTORS = REPOSITORY / "docs" / "vectors"
_DONE = json.loads((_VECTORS / "face_done.json").read_text())
_ARRAYS = [one["name"] for one in _DONE["header"]["face"]["arrays"]]


def vector(name: str) -> list[bytes]:
    """Give the parts of a vector, cut out of its file as docs/wire.md says."""
    sizes = json.loads((_VECTORS / f"{name}.json").read_text())["parts"]
    data, ends = (_VECTORS / f"{name}.bin").read_bytes(), np.cumsum(sizes)
    assert ends[-1] == len(data)
    return [data[end - size:end] for size, end in zip(sizes, ends, strict=True)]


def changed(header: bytes, **fields: Any) -> bytes:
    """Give a header with other values in fields that it has."""
    tree = json.loads(header)
    return json.dumps(tree | {name: value for name, value in fields.items() if name in tree}
                      ).encode()


def bound(context: zmq.Context, address: str) -> tuple[zmq.Socket, zmq.Socket]:
    """Bind as a hub does, as soon as the address is free."""
    def bind(kind: int, to: str) -> zmq.Socket | None:
        socket = context.socket(kind)
        socket.linger = 0
        with suppress(zmq.ZMQError):
            socket.bind(to)
            return socket
        socket.close()
        return None

    return tuple(until(lambda kind=kind, to=to: bind(kind, to)) for kind, to in (
        (zmq.ROUTER, address), (zmq.XPUB, publications_of(address))))


@dataclass
class Ended:
    """How a program ended."""

    status: int
    out: str
    err: str
    points: np.ndarray | None
    """What it wrote, if it did."""
    heard: list[str]
    """Kinds of what it said; what it said again after its answer had been sent counts once."""


def served(
    command: Program, folder: Path, answers: Mapping[str, list[list[bytes]]],
    published: list[bytes] | None = None, restart_after: str = "",
) -> Ended:
    """Be the hub of a program until it ends.

    Parameters
    ----------
    answers : for each kind of request the answers, one after another, the last one repeated; ids
        and numbers become those of the request. An empty one is lost
    published : what is published, once, when `get_next` finds nothing newer
    restart_after : kind of request behind whose answer the hub ends, and is there again
    """
    heard: list[str] = []
    answered: dict[int, list[bytes]] = {}
    pressed, again = "", False

    def publish() -> None:
        nonlocal published
        assert published
        assert publisher.poll(LIMIT_MS)
        assert publisher.recv() == b"\x01faces"
        topic, face, *rest = published
        publisher.send_multipart([topic, changed(face, capture_id=pressed), *rest])
        published = None

    address = f"tcp://127.0.0.1:{free_port()}"
    with ExitStack() as done:
        context = zmq.Context()
        done.callback(context.destroy, linger=0)
        router, publisher = bound(context, address)
        with killed_at_the_end(subprocess.Popen(
                [*command, address], cwd=folder, text=True, stdout=subprocess.PIPE,
                stderr=subprocess.PIPE)) as process:
            while process.poll() is None:
                if not router.poll(20):
                    continue
                peer, said = router.recv_multipart()
                request = json.loads(said)
                number = request["request"]
                if number in answered:  # this was away for two seconds
                    router.send_multipart([peer, *answered[number]])
                    continue
                heard.append(request["kind"])
                pressed = request.get("capture_id", pressed)
                given = answers[request["kind"]]
                answer = given[min(heard.count(request["kind"]), len(given)) - 1]
                if not answer:
                    continue
                header, *arrays = answer
                due = published and json.loads(header)["kind"] == "nothing_newer"
                # After the answer, the program waits two seconds for it and asks again; but before,
                # it does not subscribe again at a hub that was started again.
                if due and not again:
                    publish()
                answered[number] = [
                    changed(header, request=number, capture_id=pressed), *arrays]
                router.send_multipart([peer, *answered[number]])
                if due and again:
                    publish()
                if request["kind"] == restart_after:
                    restart_after, again = "", True
                    router.close(linger=LIMIT_MS)
                    publisher.close()
                    router, publisher = bound(context, address)
            out, err = process.communicate()
    written = [np.loadtxt(path, ndmin=2) for path in folder.glob("*.xyz")]
    return Ended(process.returncode, out, err, written[0] if written else None, heard)


@pytest.fixture(scope="module", params=LANGUAGES)
def command(request, tmp_path_factory):
    return program(request.param, tmp_path_factory.mktemp("program"))


USUAL = {"find_start": [vector("start_at")], "press": [vector("press_accepted")],
         "get_next": [vector("nothing_newer"), vector("face_done.answer")]}


def test_node_reads_every_vector():
    done = subprocess.run([str(NODE), str(Path(__file__).with_name("read_vectors.mjs")),
                           str(_VECTORS)], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == sorted(
        kind.model_fields["kind"].default for kind in (*TO_HUB, *FROM_HUB))


def next_face(number: int) -> list[bytes]:
    """Give the publication of the face under another number."""
    topic, header, *arrays = vector("face_done")
    return [topic, changed(header, sequence=number), *arrays]


def check_vector(points: np.ndarray | None) -> None:
    """Check that it is the face of the vector."""
    dense = _DONE["decoded"]["dense"]
    assert points is not None
    assert np.array_equal(points[:, :3].astype(np.float32), np.float32(dense["points"]))
    assert np.array_equal(points[:, 3:6], dense["colors"])
    assert np.array_equal(points[:, 6].astype(np.float32), np.float32(dense["sigma"]))


@pytest.mark.parametrize(("number", "asked"), [(43, 1), (44, 2)], ids=["next", "after a gap"])
def test_a_face_that_is_published_is_that_of_the_vector(command, tmp_path, number, asked):
    ended = served(command, tmp_path, USUAL, next_face(number))
    assert (ended.status, ended.err) == (0, "")
    assert ended.heard == ["find_start", "press", *["get_next"] * asked]
    check_vector(ended.points)


def test_a_request_whose_answer_is_lost_is_said_again(command, tmp_path):
    ended = served(command, tmp_path, USUAL | {
        "press": [[], vector("press_accepted")], "get_next": [vector("face_done.answer")]})
    assert (ended.status, ended.err) == (0, "")
    assert ended.heard == ["find_start", "press", "press", "get_next"]
    check_vector(ended.points)


def test_a_face_that_was_missed_is_asked_for(command, tmp_path):
    """Also where another store took the place of the first."""
    header, *arrays = vector("face_done.answer")
    other = [changed(header, epoch="0f"), *arrays]
    ended = served(command, tmp_path, USUAL | {"get_next": [other]})
    assert (ended.status, ended.err) == (0, "")
    assert ended.heard == ["find_start", "press", "get_next", "get_next"]
    check_vector(ended.points)


def test_a_hub_that_is_started_again_is_found_again(command, tmp_path):
    """Its publications, too."""
    ended = served(command, tmp_path, USUAL, next_face(43), restart_after="press")
    assert (ended.status, ended.err) == (0, "")
    check_vector(ended.points)


@pytest.mark.parametrize(("kind", "answer", "why"), [
    ("press", "press_refused", "no sensor is connected"),
    ("get_next", "capture_failed.answer", "no face in the picture"),
    ("find_start", "request_failed", "refused: get_next.after: expected at least 0"),
])
def test_what_the_hub_refuses_is_said_with_status_1(command, tmp_path, kind, answer, why):
    ended = served(command, tmp_path, USUAL | {kind: [vector(answer)]})
    assert ended.status == 1
    assert why in ended.out + ended.err
    assert not list(tmp_path.iterdir())


def with_fewer_points(parts: list[bytes]) -> list[bytes]:
    parts[1 + _ARRAYS.index("dense_support")] = bytes(7) + b"\x20"
    return parts


def with_more_points(parts: list[bytes]) -> list[bytes]:
    parts[1 + _ARRAYS.index("dense_support")] = b"\xff" * 8
    return parts


def cut_off(parts: list[bytes]) -> list[bytes]:
    parts[1 + _ARRAYS.index("dense_z")] = parts[1 + _ARRAYS.index("dense_z")][:-4]
    return parts


def without_sigma(parts: list[bytes]) -> list[bytes]:
    return parts[:-1]


@pytest.mark.parametrize("spoil", [
    with_fewer_points, with_more_points, cut_off, without_sigma])
def test_a_face_that_is_not_as_its_header_says_is_none(command, tmp_path, spoil):
    spoilt = spoil(vector("face_done.answer"))
    ended = served(command, tmp_path, USUAL | {"get_next": [spoilt]})
    assert ended.status == 1
    assert ended.err.count("\n") == 1
    assert not list(tmp_path.iterdir())
