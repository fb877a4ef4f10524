"""Descriptors that are kept free while connections flood in.

libzmq takes every connection, and ends the process where it has no descriptor left for one to a
socket file, or for a listener. The hub's own files need some too. Its loop looks a few times a
second, and a flood takes a thousand in less, so a thread of its own looks.
"""

import ctypes
import os
import resource
import socket
import threading

import structlog

_WANTED = 65_536
"""Descriptors that the system is asked for."""
_MAX_USED = 4096
"""Descriptors from which on connections are ended; half of all where there are fewer than 8192.
All others are there for what comes between two looks."""
_LOOK_S, _LOOK_AGAIN_S = 0.1, 0.001
"""Longest and shortest time between two looks, seconds."""
_TAKEN_PER_S = 30_000
"""Connections that libzmq takes a second at most: there is room for four times as many as come
between two looks."""
_GAP = 64
"""Descriptors in a row that are no sockets, after which no more are looked for."""
_MOST = 500
"""Descriptors that are looked at in one go, in a millisecond or two."""

_libc = ctypes.PyDLL(None)
"""Keeps Python's lock in its calls, which take microseconds: to get it back takes milliseconds."""


class DescriptorGuard:
    """Ends the connections that take descriptors beyond a ceiling; until `close`.

    The system gives the lowest number that is free: where that is the ceiling, all below it are
    taken. The limit of this process is raised as far as allowed.
    """

    def __init__(self) -> None:
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = _WANTED if hard == resource.RLIM_INFINITY else min(_WANTED, hard)
        if soft != resource.RLIM_INFINITY and soft < wanted:
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        limit, ceiling = _limit_and_ceiling()
        if ceiling < _MAX_USED:
            structlog.get_logger("hub").warning(
                "few descriptors: a flood of connections may end the hub", limit=limit,
                wanted=2 * _MAX_USED)
        self._own = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
        self._ended = 0
        self._next = 0
        """Descriptor at which the next look begins, where the last was not through."""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="descriptors", daemon=True)
        self._thread.start()

    def take_ended(self) -> int:
        """Give the number of connections that were ended since it was asked last."""
        ended = self._ended
        self._ended -= ended
        return ended

    def close(self) -> None:
        """End the thread."""
        self._stop.set()
        self._thread.join()
        os.close(self._own)

    def _run(self) -> None:
        wait = _LOOK_AGAIN_S
        while not self._stop.wait(wait):
            limit, ceiling = _limit_and_ceiling()
            lowest = self._lowest_free(limit)
            wait = min(_LOOK_S, max(_LOOK_AGAIN_S, (limit - lowest) / (4 * _TAKEN_PER_S)))
            if lowest >= ceiling:
                wait = _LOOK_AGAIN_S
                self._end_from(ceiling, (ceiling + limit) // 2, limit)

    def _end_from(self, first: int, first_local: int, limit: int) -> None:
        """End connections from a descriptor on, those to socket files from a higher one.

        So a flood from elsewhere does not close the local door. Where there are many, it goes on
        at the next look: libzmq takes its time to close what was ended.
        """
        gap = 0
        start = max(self._next, first)
        self._next = first
        for descriptor in range(start, limit):
            listens = _option(descriptor, socket.SO_ACCEPTCONN)
            if listens is None:
                gap += 1
                if gap > _GAP:
                    return
                continue
            gap = 0
            local = _option(descriptor, socket.SO_DOMAIN) == socket.AF_UNIX
            if not listens and (descriptor >= first_local or not local):
                self._ended += _libc.shutdown(descriptor, socket.SHUT_RDWR) == 0
            if descriptor - start >= _MOST:
                self._next = descriptor + 1
                return

    def _lowest_free(self, limit: int) -> int:
        number: int = _libc.dup(self._own)
        if number == -1:
            return limit
        _libc.close(number)
        return number


def _limit_and_ceiling() -> tuple[int, int]:
    """Give how many descriptors there may be, and from which on connections are ended."""
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit == resource.RLIM_INFINITY:
        limit = 2 * _WANTED
    return limit, min(_MAX_USED, limit // 2)


def _option(descriptor: int, name: int) -> int | None:
    """Give an option of a socket; None where the descriptor is none."""
    value = ctypes.c_int()
    size = ctypes.c_uint(ctypes.sizeof(value))
    failed = _libc.getsockopt(
        descriptor, socket.SOL_SOCKET, name, ctypes.byref(value), ctypes.byref(size))
    return None if failed else value.value
