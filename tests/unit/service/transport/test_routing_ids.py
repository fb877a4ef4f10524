"""Whose each routing id is: descriptors are used again, messages are read after the end."""

from denseface.service.transport._routing_ids import RoutingIds


def ids(*descriptors):
    made = RoutingIds()
    for descriptor in descriptors:
        made.opened(descriptor)
    return made


def test_an_id_is_its_first_key_s_also_after_the_connection_closed():
    made = ids(5)
    assert made.claim(b"a", "key", b"token", 5)
    assert made.is_open(b"a", b"token")
    assert not made.is_open(b"a", b"other")
    made.closed(5)
    assert not made.is_open(b"a", b"token")
    made.opened(5)
    assert not made.claim(b"a", "other key", b"other", 5)
    assert not made.is_open(b"a", b"other")
    assert made.claim(b"a", "key", b"token", 5)
    assert made.is_open(b"a", b"token")


def test_a_message_read_after_its_connection_closed_opens_nothing():
    made = ids(5)
    made.closed(5)
    assert made.claim(b"a", "key", b"token", 5)
    assert not made.is_open(b"a", b"token")
    assert not made.claim(b"a", "other key", b"other", 5)


def test_a_descriptor_is_one_connection_s():
    made = ids(5, 6)
    assert made.claim(b"a", "key", b"token", 5)
    assert made.claim(b"b", "key", b"token", 5)
    assert not made.is_open(b"a", b"token")
    assert made.is_open(b"b", b"token")
    assert made.claim(b"b", "key", b"token", 6)
    made.closed(5)
    assert made.is_open(b"b", b"token")


def test_all_may_be_closed_at_once():
    made = ids(5, 6)
    made.claim(b"a", "key", b"token", 5)
    made.all_closed()
    assert not made.is_open(b"a", b"token")
    made.closed(6)
