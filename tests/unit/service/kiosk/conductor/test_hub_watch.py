"""What a visitor is told of the hub's status."""

import asyncio

import pytest

from denseface.service.kiosk.conductor import hub_watch
from denseface.service.kiosk.conductor.hub_watch import watch_hub
from denseface.service.kiosk.conductor.trouble import GONE, service_is
from denseface.service.kiosk.page_messages import Trouble
from denseface.service.protocol.messages import Status
from denseface.service.protocol.status import SensorStatus
from tests.unit.service.kiosk.conductor.fakes import timed_out
from tests.waiting import LIMIT_S


def status(*, state="serving", workers=("w",), obstacle="", sensors=(("a", "streaming"),)):
    return Status(
        epoch="0", sequence=0, hub_version="1", sensors=tuple(name for name, _ in sensors),
        workers=workers, pressed=0, queued=0, working=0, done=0, failed=0, dead=0, refused={},
        presses_refused={}, since_start={}, latencies={}, restarts={}, state=state,
        obstacle=obstacle, retention_s=60.0, sensor_states=tuple(
            SensorStatus(name=name, state=state) for name, state in sensors))


@pytest.mark.parametrize(("given", "sensor", "trouble"), [
    (status(), None, None),
    (status(), "a", None),
    (status(), "b", Trouble.SENSOR),
    (status(sensors=(("a", "warming"),)), None, None),
    (status(sensors=(("a", "opening"),)), None, Trouble.SENSOR),
    (status(sensors=(("a", "absent"), ("b", "streaming"))), None, None),
    (status(sensors=(("a", "absent"), ("b", "streaming"))), "a", Trouble.SENSOR),
    (status(workers=()), None, Trouble.WORKER),
    (status(obstacle="queue"), None, Trouble.WORKER),
    (status(workers=(), sensors=(("a", "stalled"),)), None, Trouble.SENSOR),
    (status(obstacle="disk", sensors=()), None, Trouble.DISK),
    (status(state="rebuilding", obstacle="disk", workers=()), None, Trouble.HUB)])
def test_the_worst_is_told(given, sensor, trouble):
    told = service_is(given, sensor)
    assert (told.trouble, told.retention_s) == (trouble, 60.0)


def test_a_hub_that_is_gone_is_told_and_followed_again(monkeypatch):
    monkeypatch.setattr(hub_watch, "_AGAIN_S", 0.01)
    told = asyncio.Queue()

    class Hub:
        async def statuses(self, **_):
            yield status()
            yield None
            raise timed_out()

    async def main():
        watching = asyncio.create_task(watch_hub(Hub(), None, told.put_nowait))
        for _ in range(2):
            assert (await told.get()).trouble is None
            assert [await told.get(), await told.get()] == [GONE, GONE]
        watching.cancel()

    asyncio.run(asyncio.wait_for(main(), LIMIT_S))
