"""A physical button. No input device is at hand: a named pipe gives the records of one."""

import asyncio
import os
import struct
from contextlib import asynccontextmanager, suppress

import pytest
from structlog.testing import capture_logs

from denseface.service.errors import SettingsError
from denseface.service.kiosk.button import watch
from denseface.service.kiosk.button.presses import DEBOUNCE_S, EV_KEY, RECORD, Presses
from denseface.service.kiosk.button.watch import check_button, watch_button
from tests.waiting import LIMIT_S

SPACE = 57


def key(value, code=SPACE):
    """A record of a key with what the kernel writes around it: its scan code and a report's end."""
    return (RECORD.pack(1, 2, 4, 4, 0x7002C) + RECORD.pack(1, 2, EV_KEY, code, value)
            + RECORD.pack(1, 2, 0, 0, 0))


DOWN, UP, HELD = key(1), key(0), key(2)


def test_a_record_is_as_the_kernel_writes_it_on_this_machine():
    """Two longs, two shorts, an int: 24 bytes where a long has eight."""
    assert RECORD.size == 2 * struct.calcsize("@l") + 8


def test_a_press_counts_once_however_long_it_is_held():
    presses = Presses()
    assert presses.feed(DOWN, 1.0) == 1
    assert [presses.feed(HELD, 1.5 + index / 30) for index in range(100)] == [0] * 100
    assert presses.feed(UP, 6.0) == 0
    assert presses.feed(DOWN + UP, 6.5) == 1


def test_a_contact_that_bounces_is_one_press():
    presses = Presses()
    assert presses.feed(DOWN + UP + DOWN + UP + DOWN, 1.0) == 1
    assert presses.feed(UP + DOWN, 1.0 + DEBOUNCE_S * 0.9) == 0
    assert presses.feed(UP + DOWN, 1.1 + DEBOUNCE_S * 2) == 1


@pytest.mark.parametrize("cut", range(1, 3 * RECORD.size))
def test_records_may_come_in_pieces(cut):
    presses = Presses()
    both = DOWN + UP
    assert presses.feed(both[:cut], 1.0) + presses.feed(both[cut:], 1.0) == 1


def test_what_is_no_key_is_no_press():
    assert Presses().feed(b"".join(
        RECORD.pack(1, 2, kind, 0, 1) for kind in range(32) if kind != EV_KEY), 1.0) == 0


class Watched:
    """Presses that were told, each at another second."""

    def __init__(self):
        self.count = 0
        self.now_s = 0.0

    def pressed(self):
        self.count += 1

    def clock(self):
        self.now_s += 1
        return self.now_s


async def until(true):
    async with asyncio.timeout(LIMIT_S):
        while not true():
            await asyncio.sleep(0.01)


@asynccontextmanager
async def watching(path, **options):
    watched = Watched()
    task = asyncio.create_task(watch_button(path, watched.pressed, clock=watched.clock, **options))
    try:
        yield watched
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


@asynccontextmanager
async def plugged(path):
    """Be the device, from the moment that somebody reads it."""
    descriptors = []

    def opened():
        with suppress(OSError):  # nobody reads yet
            descriptors.append(os.open(path, os.O_WRONLY | os.O_NONBLOCK))
        return descriptors

    await until(opened)
    try:
        yield lambda data: os.write(descriptors[0], data)
    finally:
        os.close(descriptors[0])


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.setattr(watch, "_AGAIN_S", 0.01)
    made = tmp_path / "button"
    os.mkfifo(made)
    return made


def test_presses_are_told_without_any_window_and_after_a_replug(path):
    async def run():
        async with watching(path) as watched:
            async with plugged(path) as write:
                write(DOWN + HELD + UP)
                await until(lambda: watched.count == 1)
                write(DOWN)
                await until(lambda: watched.count == 2)
            await until(lambda: len(logs) >= 2)
            async with plugged(path) as write:
                write(UP + DOWN)
                await until(lambda: watched.count == 3)

    with capture_logs() as logs:
        asyncio.run(run())
    assert [one.get("reason") for one in logs][:3] == [None, "it was unplugged", None]


def test_a_button_that_is_not_there_is_said_once_and_may_come_later(path):
    path.unlink()

    async def run():
        async with watching(path) as watched:
            await until(lambda: logs)
            os.mkfifo(path)
            async with plugged(path) as write:
                write(DOWN)
                await until(lambda: watched.count == 1)

    with capture_logs() as logs:
        asyncio.run(run())
    assert [one.get("reason") for one in logs][:2] == ["No such file or directory", None]


def test_it_is_taken_from_other_programs_where_that_is_wanted(path, monkeypatch):
    asked = []
    monkeypatch.setattr(watch.fcntl, "ioctl", lambda _, *what: asked.append(what))

    async def run(**options):
        async with watching(path, **options), plugged(path):
            pass

    asyncio.run(run())
    assert asked == []
    asyncio.run(run(grab=True))
    assert asked == [(0x40044590, 1)]


def test_what_cannot_be_taken_is_said_and_shared(path):
    async def run():
        async with watching(path, grab=True) as watched, plugged(path) as write:
            write(DOWN)
            await until(lambda: watched.count == 1)

    with capture_logs() as logs:
        asyncio.run(run())
    assert "shared with other programs" in logs[0]["event"]


def test_a_path_of_something_else_is_refused_in_one_line(path, tmp_path):
    check_button(path)
    check_button(tmp_path / "plugged_in_later")
    for wrong in (tmp_path, tmp_path / "file"):
        if wrong is not tmp_path:
            wrong.touch()
        with pytest.raises(SettingsError, match=f"--kiosk-button {wrong}: expected an input dev"):
            check_button(wrong)
