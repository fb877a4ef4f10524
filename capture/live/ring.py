"""Memory for the frames of one stream, allocated once: filled, leased and filled again.

A slot that somebody holds is never written. Where all are held the newest frame finds no room,
which the reader counts as lost: it waits for nobody.
"""

import mmap
import threading
import weakref
from collections import deque

import numpy as np
from numpy.typing import NDArray

__all__ = ["Ring", "Slot"]


class Slot:
    """A piece of the ring's memory; its holders share it."""

    def __init__(self, ring: "Ring", memory: NDArray[np.uint8]) -> None:
        self.memory = memory
        """(n,) uint8."""
        self.holders = 0
        self._lock = ring.lock
        # Else a ring that is closed stays, 18 MB, until the garbage collector looks for cycles.
        self._ring = weakref.ref(ring)

    def hold(self) -> "Slot":
        """Hold it once more; only who holds it may let others."""
        with self._lock:
            if not self.holders:
                raise RuntimeError("a slot that nobody holds may be written at any time")
            self.holders += 1
        return self

    def release(self) -> None:
        """Hold it no more: the last holder gives it back."""
        with self._lock:
            if not self.holders:
                raise RuntimeError("a slot was released more often than held")
            self.holders -= 1
            if not self.holders:
                ring = self._ring()
                if ring is not None:
                    ring.free.append(self)


class Ring:
    """Slots for the frames of one stream.

    Parameters
    ----------
    slots : how many; one is being written while the others are held
    size : of each, bytes
    """

    def __init__(self, slots: int, size: int) -> None:
        if slots < 1 or size < 1:
            raise ValueError(f"slots and size must be at least 1, got {slots}, {size}")
        self.lock = threading.Lock()
        # Mapped, so that it goes back to the system: malloc keeps what threads come and go with.
        memory = np.frombuffer(mmap.mmap(-1, slots * size), np.uint8).reshape(slots, size)
        self.free = deque(Slot(self, part) for part in memory)

    def claim(self) -> Slot | None:
        """Give the slot that was free for longest, held by the caller; None where none is free."""
        with self.lock:
            if not self.free:
                return None
            slot = self.free.popleft()
            slot.holders = 1
        return slot
