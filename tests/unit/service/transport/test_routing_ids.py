"""Whose each routing id is: descriptors are used again, messages are read after the end."""

import os
import socket

import pytest

from denseface.service.transport._routing_ids import RoutingIds


@pytest.fixture
def descriptors():
    """Two descriptors of connections."""
    ends = socket.socketpair()
    yield [end.fileno() for end in ends]
    for end in ends:
        end.close()


@pytest.fixture
def ids(descriptors):
    made = RoutingIds()
    for descriptor in descriptors:
        made.opened(descriptor)
    return made


def test_an_id_is_its_first_key_s_also_after_the_connection_closed(ids, descriptors):
    one, _ = descriptors
    assert ids.claim(b"a", "key", b"token", one)
    assert ids.is_open(b"a", b"token")
    assert not ids.is_open(b"a", b"other")
    ids.closed(one)
    assert not ids.is_open(b"a", b"token")
    ids.opened(one)
    assert not ids.claim(b"a", "other key", b"other", one)
    assert not ids.is_open(b"a", b"other")
    assert ids.claim(b"a", "key", b"token", one)
    assert ids.is_open(b"a", b"token")


def test_a_message_read_after_its_connection_closed_opens_nothing(ids, descriptors):
    one, _ = descriptors
    ids.closed(one)
    assert ids.claim(b"a", "key", b"token", one)
    assert not ids.is_open(b"a", b"token")
    assert not ids.claim(b"a", "other key", b"other", one)


def test_a_descriptor_is_one_connection_s(ids, descriptors):
    one, other = descriptors
    assert ids.claim(b"a", "key", b"token", one)
    assert ids.claim(b"b", "key", b"token", one)
    assert not ids.is_open(b"a", b"token")
    assert ids.is_open(b"b", b"token")
    assert ids.claim(b"b", "key", b"token", other)
    ids.closed(one)
    assert ids.is_open(b"b", b"token")


def test_a_descriptor_that_is_another_s_is_not_open_before_the_monitor_says_so(ids, descriptors):
    one, _ = descriptors
    assert ids.claim(b"a", "key", b"token", one)
    reader, writer = os.pipe()
    os.dup2(reader, one)  # closes it, and gives its number to another
    assert not ids.is_open(b"a", b"token")
    ids.opened(one)
    assert not ids.has_spoken(one)
    assert ids.count("key") == 0
    os.close(reader)
    os.close(writer)


def test_a_key_s_connections_are_counted(ids, descriptors):
    one, other = descriptors
    assert ids.count("key") == 0
    for routing_id, descriptor in ((b"a", one), (b"b", other), (b"c", other)):
        assert ids.claim(routing_id, "key", b"token", descriptor)
    assert (ids.count("key"), ids.count("other key")) == (2, 0)
    assert ids.has_spoken(one)
    ids.closed(one)
    assert ids.count("key") == 1
    ids.closed(other)
    assert ids.count("key") == 0


def test_all_may_be_closed_at_once(ids, descriptors):
    one, other = descriptors
    ids.claim(b"a", "key", b"token", one)
    ids.all_closed()
    assert not ids.is_open(b"a", b"token")
    ids.closed(other)


def test_whose_connection_closed_is_told_once_and_not_of_those_that_were_cut(ids, descriptors):
    one, other = descriptors
    ids.claim(b"a", "key", b"token", one)
    ids.closed(one)
    ids.closed(other)  # by it nothing was said
    assert ids.has_closed
    assert ids.take_closed() == [b"tokena"]
    assert not ids.has_closed
    assert ids.take_closed() == []
    ids.opened(one)
    ids.claim(b"a", "key", b"token", one)
    ids.all_closed()
    assert ids.take_closed() == []


def test_an_id_that_moved_to_another_connection_is_not_gone_with_the_first(ids, descriptors):
    one, other = descriptors
    ids.claim(b"a", "key", b"token", one)
    ids.claim(b"a", "key", b"token", other)
    ids.closed(one)
    assert ids.take_closed() == []
