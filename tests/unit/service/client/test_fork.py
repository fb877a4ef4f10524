"""A client that was made before a fork: the child is told, the parent is not harmed."""

import subprocess
import sys

import pytest

from denseface.service.protocol.topics import Topic
from tests.unit.service.fake_hub import fake_hub
from tests.waiting import LIMIT_S

_HEAD = """
import asyncio
import os
import sys
import warnings
from denseface.service.client import AsyncClient, Client, Operator
from denseface.service.errors import ClientForkedError

warnings.simplefilter("ignore")  # of newer Pythons: libzmq has threads
address = sys.argv[1]

def in_child(check):
    # Run it in a forked process and wait for that to say that all was well.
    child = os.fork()
    if child == 0:
        try:
            check()
        except BaseException as error:
            print(repr(error), file=sys.stderr, flush=True)
            os._exit(1)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0

def told(call):
    try:
        call()
    except ClientForkedError as error:
        assert "make a new one here" in str(error)
    else:
        raise AssertionError("not told")

def serves():
    with Client(address) as new:
        assert new.status().sensors == ("s",)
"""
_BLOCKING = """
with Operator(address) as client:
    begun = client.faces(after=0)
    next(begun)

    def check():
        for call in (lambda: client.press(timeout=10), lambda: client.get("a"), client.status,
                     lambda: next(client.faces()), lambda: next(client.previews()),
                     lambda: next(client.dead()), lambda: next(begun)):
            told(call)
        begun.close()
        client.close()
        client.close()
        told(client.status)
        serves()

    in_child(check)
    assert client.status().sensors == ("s",)
    client.press("b")
    print("forked", flush=True)
    next(begun)
"""
_ASYNCIO = """
async def main():
    async with AsyncClient(address) as client:
        begun = client.faces(after=0)
        await anext(begun)
        under_way = asyncio.create_task(client.get("b"))
        following = asyncio.create_task(anext(begun))
        while not client._pending or not client._readable_events:
            await asyncio.sleep(0)

        def check():
            for call in (client.status, lambda: client.press(timeout=10),
                         lambda: anext(client.faces()), lambda: anext(client.previews())):
                coroutine = call()
                told(lambda: coroutine.send(None))
            client.close()
            under_way.cancel()
            following.cancel()
            serves()

        in_child(check)
        assert (await client.status()).sensors == ("s",)
        print("forked", flush=True)
        await under_way
        await following

asyncio.run(main())
"""


@pytest.mark.parametrize("code", [_BLOCKING, _ASYNCIO], ids=["blocking", "asyncio"])
def test_a_client_is_not_for_a_forked_process(code):
    with fake_hub() as hub:
        hub.conclude("a")
        hub.ignored.add("get_face")  # so that the call is under way
        with subprocess.Popen(
                [sys.executable, "-c", _HEAD + code, hub.address],
                stdout=subprocess.PIPE, text=True) as process:
            try:
                assert process.stdout.readline() == "forked\n"
                hub.wait(lambda: hub.subscribers(Topic.FACES) == 1)
                hub.conclude("b")
                hub.ignored.clear()
                assert process.wait(LIMIT_S) == 0
            finally:
                process.kill()
