"""Memory that somebody holds is never given out to be written."""

import gc
import threading
import weakref

import pytest

from denseface.capture.live.ring import Ring


def test_the_slot_that_was_free_for_longest_is_written_next():
    ring = Ring(2, 4)
    first, second = ring.claim(), ring.claim()
    assert first is not None
    assert second is not None
    assert ring.claim() is None
    second.release()
    first.release()
    assert ring.claim() is second


def test_the_last_holder_gives_it_back():
    ring = Ring(1, 4)
    slot = ring.claim()
    assert slot is not None
    slot.hold().release()
    assert ring.claim() is None
    slot.release()
    assert ring.claim() is slot


def test_what_nobody_holds_can_be_neither_held_nor_released():
    slot = Ring(1, 4).claim()
    assert slot is not None
    slot.release()
    for call in (slot.hold, slot.release):
        with pytest.raises(RuntimeError, match="slot"):
            call()


@pytest.mark.parametrize(("slots", "size"), [(0, 4), (1, 0)])
def test_a_senseless_size_is_refused(slots, size):
    with pytest.raises(ValueError, match="at least 1"):
        Ring(slots, size)


def test_threads_never_share_a_slot_that_is_written():
    ring, wrong = Ring(3, 8), []

    def use(name):
        for _ in range(2000):
            if slot := ring.claim():
                slot.memory[:] = name
                slot.hold()
                if (slot.memory != name).any():
                    wrong.append(name)
                slot.release()
                slot.release()

    threads = [threading.Thread(target=use, args=(name,)) for name in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert len(ring.free) == 3


def test_memory_goes_with_its_ring_at_once():
    """A sensor that is opened again and again would take more and more."""
    gc.disable()
    try:
        ring = Ring(2, 4)
        held = ring.claim()
        assert held is not None
        memory, free = weakref.ref(held.memory), weakref.ref(ring.free[0])
        del ring
        assert free() is None
        held.release()
        del held
        assert memory() is None
    finally:
        gc.enable()
