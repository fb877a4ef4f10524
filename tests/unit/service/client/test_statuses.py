"""Following how the hub is, and that it is gone."""

import asyncio
from contextlib import aclosing, closing

import pytest

from denseface.service.client import AsyncClient, Client
from denseface.service.errors import ClientClosedError, ClientTimeoutError
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from tests.unit.service.client.test_clients import run, waited
from tests.unit.service.fake_hub import FakeHub, fake_hub
from tests.waiting import LIMIT_S

FIRST_S = "denseface.service.client.statuses._FIRST_S"


@pytest.fixture
def hub():
    with fake_hub() as hub:
        yield hub


def tell(hub, **more):
    hub.publish(Topic.STATUS, Packet(hub.status(**more)))


def test_each_is_given_then_that_the_hub_is_gone_once_then_that_it_is_back(hub, monkeypatch):
    monkeypatch.setattr(FIRST_S, LIMIT_S)

    async def main():
        async with (AsyncClient(hub.address) as client,
                    aclosing(client.statuses(timeout=LIMIT_S)) as statuses):
            first = asyncio.create_task(anext(statuses))
            await waited(hub, lambda: hub.subscribers(Topic.STATUS))
            for retention_s in (60.0, None):
                tell(hub, retention_s=retention_s, heartbeat_s=LIMIT_S)
                assert (await (first or anext(statuses))).retention_s == retention_s
                first = None
            await asyncio.to_thread(hub.close)
            assert await anext(statuses) is None
            coming = asyncio.create_task(anext(statuses))
            again = await asyncio.to_thread(FakeHub, hub.address)
            try:
                await waited(again, lambda: again.subscribers(Topic.STATUS))
                tell(again, obstacle="disk")
                assert (await coming).obstacle == "disk"
            finally:
                await asyncio.to_thread(again.close)

    run(main())


def test_a_hub_that_is_silent_for_three_of_its_heartbeats_is_gone(hub, monkeypatch):
    monkeypatch.setattr(FIRST_S, 0.1)
    with (Client(hub.address) as client,
          closing(client.statuses(timeout=LIMIT_S)) as statuses):
        assert next(statuses) is None
        hub.wait(lambda: hub.subscribers(Topic.STATUS))
        tell(hub, heartbeat_s=0.01)
        assert next(statuses).sensors == ("s",)
        assert next(statuses) is None
        tell(hub)
        assert next(statuses)


def test_where_there_is_no_hub_it_says_so_and_then_waits(tmp_path, monkeypatch):
    monkeypatch.setattr(FIRST_S, 0.1)
    with (Client(f"ipc://{tmp_path}/hub") as client,
          closing(client.statuses(timeout=0.5)) as statuses):
        assert next(statuses) is None
        with pytest.raises(ClientTimeoutError, match="nothing was published"):
            next(statuses)


def test_closing_the_client_ends_it(hub, monkeypatch):
    monkeypatch.setattr(FIRST_S, 0.1)

    async def main():
        async with AsyncClient(hub.address) as client:
            async for known in client.statuses():
                assert known is None
                client.close()

    run(main())
    client = Client(hub.address)
    statuses = client.statuses()
    assert next(statuses) is None
    client.close()
    with pytest.raises(ClientClosedError):
        next(statuses)
