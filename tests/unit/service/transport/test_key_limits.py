"""How often one key may connect."""

from denseface.service.transport._key_limits import KeyLimits


def test_a_key_connects_as_often_as_it_needs_and_no_more():
    now = [0.0]
    limits = KeyLimits(lambda: now[0])
    assert sum(limits.take_handshake("many") for _ in range(1000)) == 256
    assert limits.take_handshake("other")
    now[0] = 10.0
    assert sum(limits.take_handshake("many") for _ in range(1000)) == 20
    now[0] = 1e6
    assert sum(limits.take_handshake("many") for _ in range(1000)) == 256
