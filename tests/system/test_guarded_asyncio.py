"""The asyncio client at a guarded listener: accepted, refused with a reason, cut off."""

import asyncio
from contextlib import aclosing

import numpy as np
import pytest

from denseface.service.client import AsyncClient
from denseface.service.errors import KeyRefusedError, RequestFailedError
from denseface.service.protocol.roles import Role
from denseface.service.security import revoke
from tests.system.guarded import guarded_hub, press_through
from tests.unit.service.faces import small_face
from tests.waiting import LIMIT_S, PATIENCE


@pytest.fixture(scope="module")
def hub(tmp_path_factory):
    with guarded_hub(tmp_path_factory.mktemp("hub")) as hub:
        yield hub


def _client(hub, name):
    return AsyncClient(hub.address, key=hub.secret(name), hub_key=hub.hub_key)


def _run(main):
    return asyncio.run(asyncio.wait_for(main, 100 * PATIENCE))


def test_a_subscriber_follows_what_is_published(hub):
    async def main():
        async with _client(hub, "subscriber") as client:
            after = (await client.status(timeout=LIMIT_S)).sequence
            async with aclosing(client.published(after=after, timeout=LIMIT_S)) as published:
                pressing = asyncio.create_task(asyncio.to_thread(press_through, hub, "awaited"))
                outcome = await anext(published)
                await pressing
            assert outcome.capture_id == "awaited"
            np.testing.assert_array_equal(outcome.face.dense.points, small_face().dense.points)
            face = await client.get("awaited", timeout=LIMIT_S)
            assert len(face.dense) == len(outcome.face.dense)

    _run(main())


def test_the_wrong_role_is_told_so(hub):
    async def main():
        async with _client(hub, "subscriber") as client:
            with pytest.raises(RequestFailedError, match="press needs the role presser"):
                await client.press("never", timeout=LIMIT_S)
        async with _client(hub, "presser") as client, aclosing(client.previews()) as previews:
            with pytest.raises(KeyRefusedError, match="not allowed there for this"):
                await anext(previews)

    _run(main())


def test_a_hub_that_dies_is_known_to_be_gone(tmp_path):
    async def main():
        with guarded_hub(tmp_path) as mortal:
            async with (_client(mortal, "subscriber") as client,
                        aclosing(client.statuses(timeout=LIMIT_S)) as statuses):
                while (status := await anext(statuses)) is None:
                    pass  # it has not begun
                assert status.retention_s == 86400.0
                mortal.process.kill()
                while await anext(statuses) is not None:
                    pass  # what it said last
            async with (_client(mortal, "presser") as client,
                        aclosing(client.statuses(timeout=LIMIT_S)) as statuses):
                assert await anext(statuses) is None

    _run(main())


def test_a_key_that_is_not_allowed_is_told_so(hub):
    hub.new_key("aio-stranger")

    async def main():
        async with _client(hub, "aio-stranger") as client:
            with pytest.raises(KeyRefusedError, match="not allowed"):
                await client.status(timeout=LIMIT_S)

    _run(main())


def test_a_key_revoked_while_it_follows_ends_the_iteration(hub):
    hub.new_key("aio-former", Role.SUBSCRIBER)

    async def main():
        async with _client(hub, "aio-former") as client, aclosing(
                client.published(timeout=LIMIT_S)) as published:
            following = asyncio.create_task(anext(published))
            assert (await client.status(timeout=LIMIT_S)).epoch
            revoke(hub.keys, "aio-former")
            with pytest.raises(KeyRefusedError, match="revoked"):
                await following

    _run(main())
