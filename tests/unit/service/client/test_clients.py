"""Both clients against a made-up hub: the asyncio one as the blocking one."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import aclosing, closing

import cv2
import numpy as np
import psutil
import pytest

import denseface
from denseface.service.client import AsyncClient, AsyncOperator, Client, Operator, follower
from denseface.service.client.exchanges import AwaitPublication
from denseface.service.errors import (
    ClientClosedError,
    ClientTimeoutError,
    LocalProtocolError,
    PressRefusedError,
    RemoteProtocolError,
    UnknownCaptureError,
)
from denseface.service.protocol import messages
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from tests.unit.service.faces import jpeg, small_frame
from tests.unit.service.fake_hub import fake_hub
from tests.waiting import LIMIT_S, until


@pytest.fixture
def hub():
    with fake_hub() as hub:
        yield hub


def run(main):
    """Run a coroutine; what asyncio has to complain of is an error."""
    complaints = []

    async def watched():
        asyncio.get_running_loop().set_exception_handler(lambda _, what: complaints.append(what))
        return await asyncio.wait_for(main, LIMIT_S)

    result = asyncio.run(watched())
    assert complaints == []
    return result


async def waited(hub, true):
    await asyncio.to_thread(hub.wait, true)


def test_press_get_status(hub):
    async def main():
        async with AsyncClient(hub.address) as client:
            assert await client.press("a") == "a"
            hub.conclude("a")
            face = await client.get("a")
            assert (await client.status()).sensors == ("s",)
            return face

    with Client(hub.address) as client:
        awaited = run(main())
        assert client.press("a") == "a"
        np.testing.assert_array_equal(client.get("a").dense.points, awaited.dense.points)


def test_a_frame_is_fetched(hub):
    hub.frames = {"a"}

    async def main():
        async with AsyncClient(hub.address) as client:
            with pytest.raises(UnknownCaptureError, match="b: the hub has no such capture"):
                await client.get_frame("b")
            return await client.get_frame("a")

    with Client(hub.address) as client:
        awaited, frame = run(main()), client.get_frame("a")
        np.testing.assert_array_equal(frame.depth, awaited.depth)
        np.testing.assert_array_equal(frame.rgb, small_frame().rgb)
        for call in (client.get, client.get_frame):
            with pytest.raises(LocalProtocolError, match=r"capture id '\.\./x'"):
                call("../x")


def test_errors_are_those_of_the_blocking_client(hub):
    async def main():
        async with AsyncClient(hub.address) as client:
            with pytest.raises(UnknownCaptureError):
                await client.get("never")
            with pytest.raises(LocalProtocolError, match="capture id"):
                await client.press("../x")
            hub.refuse = "no room"
            with pytest.raises(PressRefusedError, match="press refused: no room") as refused:
                await client.press()
            assert refused.value.reason == "disk"
            hub.ignored = {"get_status"}
            with pytest.raises(ClientTimeoutError, match=r"no answer from the hub within 0\.1 s"):
                await client.status(timeout=0.1)

    run(main())


def test_an_answer_of_another_release_is_no_time_out(hub):
    hub.garble_header = lambda header: header.replace(b'"version":2', b'"version":3')
    words = "hub: the hub's answer cannot be read: version: found 3, expected 2"

    async def main():
        async with AsyncClient(hub.address) as client:
            with pytest.raises(RemoteProtocolError, match=words):
                await client.press("a", timeout=LIMIT_S)
            hub.garble_header = bytes
            assert await client.press("a") == "a"

    with Client(hub.address) as client:
        with pytest.raises(RemoteProtocolError, match=words):
            client.press("a", timeout=LIMIT_S)
        run(main())


def test_calls_share_a_client_and_the_last_may_be_answered_first(hub):
    async def main():
        async with AsyncClient(hub.address) as client:
            hub.ignored = {"press"}
            client._resend_s = 0.1
            slow = asyncio.ensure_future(client.press("a"))
            await waited(hub, lambda: "press" in hub.received)
            assert (await client.status()).sequence == 0
            assert not slow.done()
            hub.ignored = set()
            assert await slow == "a"
            assert await asyncio.gather(*(client.press(f"p{n}") for n in range(20))) == [
                f"p{n}" for n in range(20)]

    run(main())


def test_what_is_missed_is_fetched(hub):
    async def main():
        hub.conclude("a1")
        async with AsyncClient(hub.address) as client:
            published = client.published(after=0, timeout=LIMIT_S)
            assert (await anext(published)).capture_id == "a1"
            await waited(hub, lambda: hub.subscribers(Topic.FACES) == 1)
            hub.conclude("a2", published=False)
            hub.conclude("a3")
            assert [(await anext(published)).capture_id for _ in range(2)] == ["a2", "a3"]
            hub.garble(Topic.FACES)
            hub.conclude("a4", published=False)
            assert (await anext(published)).capture_id == "a4"
            await published.aclose()
            await waited(hub, lambda: hub.subscribers(Topic.FACES) == 0)

    run(main())


def test_faces_alone(hub):
    async def main():
        hub.conclude("a")
        async with AsyncClient(hub.address) as client, aclosing(client.faces(after=0)) as faces:
            assert len((await anext(faces)).dense) > 0
            with pytest.raises(LocalProtocolError, match="at most one"):
                await anext(client.faces(after=0, last=1))

    run(main())


def test_silence_is_a_time_out(hub, monkeypatch):
    waits = []

    def short(seconds):
        """The hub may be slow to say where to start: only what it publishes is not waited for."""
        waits.append(seconds)
        return AwaitPublication(0.1)

    async def main():
        async with AsyncClient(hub.address) as client:
            for following in (client.published(timeout=LIMIT_S), client.previews(timeout=0.1)):
                with pytest.raises(ClientTimeoutError, match="nothing was published"):
                    await anext(following)

    monkeypatch.setattr(follower, "AwaitPublication", short)
    run(main())
    (asked,) = waits
    assert 0 < asked < LIMIT_S


def test_previews_are_always_the_newest(hub):
    async def main():
        async with AsyncClient(hub.address) as client, aclosing(client.previews()) as previews:
            first = asyncio.ensure_future(anext(previews))
            await waited(hub, lambda: hub.subscribers(Topic.PREVIEW) == 1)
            hub.garble(Topic.PREVIEW)
            hub.preview(1)
            shown = await first
            assert (shown.sequence, shown.timestamp_us, shown.image.shape) == (1, 1, (1, 2, 3))
            for number in range(2, 6):
                hub.preview(number)
            found = []
            while not found or found[-1] != 5:
                found.append((await anext(previews)).sequence)
            assert found == sorted(set(found))

    run(main())


def test_the_blocking_client_s_previews_pass_over_what_is_old(hub):
    with Client(hub.address) as client:
        previews = client.previews(timeout=LIMIT_S)
        started = threading.Thread(target=lambda: (
            hub.wait(lambda: hub.subscribers(Topic.PREVIEW) == 1), hub.preview(1)))
        started.start()
        assert next(previews).sequence == 1
        started.join()
        hub.preview(2)
        assert next(previews).image.tolist() == [[[2, 2, 2], [2, 2, 2]]]
        previews.close()
        hub.wait(lambda: hub.subscribers(Topic.PREVIEW) == 0)
        with pytest.raises(ClientTimeoutError):
            next(client.previews(timeout=0.05))


HINT = Hint(timestamp_us=4, codes=("too_far",), text="come closer", measures={"distance_mm": 9.0})


def test_a_jpeg_is_decoded_when_it_is_asked_for(hub):
    red = np.full((30, 40, 3), (0, 0, 255), np.uint8)
    data = cv2.imencode(".jpg", red)[1].tobytes()
    with Client(hub.address) as client:
        previews = client.previews(timeout=LIMIT_S)
        with ThreadPoolExecutor() as pool:
            first = pool.submit(next, previews)
            hub.wait(lambda: hub.subscribers(Topic.PREVIEW) == 1)
            hub.jpeg(1, data, "s", HINT)
            shown = first.result()
        assert (shown.jpeg, shown.sensor, shown.size) == (data, "s", (40, 30))
        assert (shown.hint.text, shown.hint.ok) == ("come closer", False)
        assert shown.image.shape == (30, 40, 3)
        assert np.abs(shown.image.astype(int) - (255, 0, 0)).max() < 5
        assert shown.image is shown.image
        with pytest.raises(ValueError, match="read-only"):
            shown.image[0] = 0
        hub.jpeg(2, data[:-200] + bytes(200), "s")
        until(lambda: next(previews).sequence == 2)
        hub.jpeg(3, data[:data.index(b"\xff\xda")] + b"\xff\xd9", "s")
        damaged = next(previews)
        with pytest.raises(RemoteProtocolError, match="preview 3: the JPEG cannot be decoded"):
            _ = damaged.image


@pytest.mark.parametrize("kind", ["previews", "hints"])
def test_of_several_sensors_the_one_that_is_asked_for_is_followed(hub, kind):
    topic = {"previews": Topic.PREVIEW, "hints": Topic.HINTS}[kind]

    def publish():
        for number, sensor in enumerate("sososo"):
            if kind == "hints":
                hub.publish(topic, Packet(messages.Hints(sensor=sensor, hint=HINT)))
            else:
                hub.jpeg(number, jpeg(4, 3), sensor)

    async def main():
        async with AsyncClient(hub.address) as client, \
                aclosing(getattr(client, kind)(sensor="s")) as following:
            first = asyncio.ensure_future(anext(following))
            await waited(hub, lambda: hub.subscribers(topic) == 1)
            publish()
            return await first

    assert run(main()).sensor == "s"
    hub.wait(lambda: hub.subscribers(topic) == 0)  # the first is gone: the one below is the second
    with Client(hub.address) as client, \
            closing(getattr(client, kind)(sensor="o", timeout=LIMIT_S)) as following, \
            ThreadPoolExecutor() as pool:
        first = pool.submit(next, following)
        hub.wait(lambda: hub.subscribers(topic) == 1)
        publish()
        assert first.result().sensor == "o"


def test_gate_and_sensor_are_said_and_a_refusal_says_what_to_do(hub):
    async def main():
        async with AsyncClient(hub.address) as client:
            return await client.press("b", gate="refuse", frames=3)

    hub.refuse, hub.refuse_reason, hub.hint = "come closer", "quality", HINT
    with Client(hub.address) as client:
        with pytest.raises(PressRefusedError, match="press refused: come closer") as refused:
            client.press("a", sensor="kinect", gate="wait", gate_timeout=3)
        assert (refused.value.reason, refused.value.codes, refused.value.text) == (
            "quality", ("too_far",), "come closer")
    with pytest.raises(PressRefusedError):
        run(main())
    first, second = hub.presses
    assert (first.sensor, first.gate, first.gate_timeout, first.frames) == ("kinect", "wait", 3, 1)
    assert (second.sensor, second.gate, second.frames) == (None, "refuse", 3)


def test_a_gated_press_is_waited_for_as_much_longer(hub):
    hub.ignored = {"press"}
    with Client(hub.address) as client, pytest.raises(ClientTimeoutError, match=r"within 0\.3 s"):
        client.press("a", gate="wait", gate_timeout=0.2, timeout=0.1)


@pytest.mark.parametrize(("how", "words"), [
    ({"sensor": "a b"}, "sensor: .* 'a b'"), ({"gate": "maybe"}, "gate: .* 'maybe'"),
    ({"gate_timeout": 121}, "gate_timeout: .* 121"), ({"frames": 0}, "frames: .* 0")])
def test_what_is_wrong_with_a_press_is_named(hub, how, words):
    with Client(hub.address) as client, pytest.raises(LocalProtocolError, match=words):
        client.press("a", **how)


def test_a_call_that_is_cancelled_leaves_the_client_as_it_was(hub):
    async def main():
        async with AsyncClient(hub.address) as client:
            hub.ignored = {"press"}
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.2):
                    await client.press("a")
            call = asyncio.ensure_future(client.press("b"))
            await waited(hub, lambda: "b" in hub.pressed)
            call.cancel()
            with pytest.raises(asyncio.CancelledError):
                await call
            assert client._pending == {}
            assert client._loop is None
            hub.ignored = set()
            assert await client.press("c") == "c"

    run(main())


def test_an_iteration_that_is_cancelled_ends_its_subscription(hub):
    async def main():
        async with AsyncClient(hub.address) as client:
            for following, topic in (
                    (client.published, Topic.FACES), (client.previews, Topic.PREVIEW)):
                async with aclosing(following()) as one:
                    coming = asyncio.create_task(anext(one))
                    await waited(hub, lambda topic=topic: (
                        hub.subscribers(topic) == 1 and client._readable_events))
                    coming.cancel()
                    with pytest.raises(asyncio.CancelledError):
                        await coming
                await waited(hub, lambda topic=topic: hub.subscribers(topic) == 0)
            assert client._readable_events == {}

    run(main())


@pytest.mark.parametrize("turns", range(5))
def test_an_iteration_that_is_cancelled_as_something_comes_ends_too(hub, turns):
    """However many turns of the loop before: a camera would be asked for pictures for ever."""
    async def main():
        async with AsyncClient(hub.address) as client:
            async def follow():
                async for _ in client.previews():
                    pass

            task = asyncio.create_task(follow())
            await waited(hub, lambda: hub.subscribers(Topic.PREVIEW) == 1)
            came, = client._readable_events.values()
            came.set()
            for _ in range(turns):
                await asyncio.sleep(0)
            task.cancel()
            await waited(hub, lambda: hub.subscribers(Topic.PREVIEW) == 0)
            with pytest.raises(asyncio.CancelledError):
                await task

    run(main())


def test_a_closed_client_ends_calls_and_iterations(hub):
    async def main():
        client = AsyncClient(hub.address)
        hub.ignored = {"press"}
        call = asyncio.ensure_future(client.press("a"))
        looks = asyncio.ensure_future(anext(client.previews(), "over"))
        await waited(hub, lambda: "press" in hub.received
                     and hub.subscribers(Topic.PREVIEW) == 1)
        client.close()
        client.close()
        with pytest.raises(ClientClosedError):
            await call
        assert await looks == "over"
        with pytest.raises(ClientClosedError):
            await client.status()
        assert await anext(client.published(), "over") == "over"

    run(main())
    with Client(hub.address) as client:
        client.close()
        with pytest.raises(ClientClosedError):
            client.status()


def test_no_descriptor_is_left_open(hub):
    async def once():
        async with AsyncClient(hub.address) as client:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.05):
                    await anext(client.previews())
            await client.status()

    run(once())
    before = psutil.Process().num_fds()
    for _ in range(5):
        run(once())
    # libzmq closes what the hub's side of a connection had a moment later.
    until(lambda: psutil.Process().num_fds() < before + 5)


def test_it_is_part_of_the_public_face():
    assert denseface.AsyncClient is AsyncClient


def test_a_withdrawal_ends_when_the_hub_says_so_and_its_press_with_it(hub):
    async def main():
        async with AsyncClient(hub.address) as client:
            hub.ignored = {"press"}
            pressing = asyncio.create_task(client.press("a", timeout=LIMIT_S))
            await waited(hub, lambda: "press" in hub.received)
            hub.removals = [(1, False)]
            assert await client.withdraw("a", timeout=LIMIT_S) == 1
            with pytest.raises(PressRefusedError, match="withdrawn") as refused:
                await pressing
            assert refused.value.reason == "purged"
            with pytest.raises(LocalProtocolError, match="capture id"):
                await client.withdraw("../x")

    run(main())
    with Client(hub.address) as client:
        hub.removals = [(0, False)]
        assert client.withdraw("a") == 0
        with pytest.raises(PressRefusedError):
            client.press("a")
    assert hub.received.count("press") == 1


def test_an_operator_asks_the_same_of_both_clients(hub):
    async def main():
        async with AsyncOperator(hub.address) as operator:
            with pytest.raises(LocalProtocolError, match="last: expected 1 to 50, found 51"):
                await operator.captures(51)
            listed = await operator.captures(2, timeout=LIMIT_S)
            dead = [one async for one in operator.dead(timeout=LIMIT_S)]
            with pytest.raises(UnknownCaptureError):
                await operator.drop("never", timeout=LIMIT_S)
            with pytest.raises(UnknownCaptureError):
                await operator.retry("never", timeout=LIMIT_S)
            await operator.restart_sensor("s", timeout=LIMIT_S)
            hub.removals = [(2, True), (1, False)]
            assert await operator.purge(everything=True, timeout=LIMIT_S) == 3
            return listed, dead

    listed, dead = run(main())
    assert [one.capture_id for one in listed] == ["b", "a"]
    assert [one.capture_id for one in dead] == ["dead"]
    with Operator(hub.address) as operator:
        assert operator.captures(2) == listed
        assert [*operator.dead()] == dead
        operator.restart_sensor("s")
    assert hub.received.count("restart_sensor") == 2


def test_a_purge_goes_on_while_some_is_left(hub):
    hub.removals = [(2, True), (0, True), (0, True), (1, False)]
    with Operator(hub.address) as operator:
        assert operator.purge(everything=True, timeout=LIMIT_S) == 3
        with pytest.raises(ClientTimeoutError):
            operator.purge(everything=True, timeout=0.1)
