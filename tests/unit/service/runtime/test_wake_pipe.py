import os
import select

from denseface.service.runtime.wake_pipe import WakePipe


def readable(wake):
    return bool(select.select([wake], [], [], 0)[0])


def test_it_is_readable_until_it_is_drained():
    with WakePipe() as wake:
        assert not readable(wake)
        wake.wake()
        wake.wake()
        assert readable(wake)
        wake.drain()
        assert not readable(wake)
        wake.drain()


def test_however_often_it_is_woken_nothing_blocks_or_remains():
    with WakePipe() as wake:
        os.write(wake.writer, bytes(2**16))
        wake.wake()
        wake.drain()
        assert not readable(wake)
