"""A listener, its keys and who connects, within one process."""

import socket
import time

import pytest
import zmq
from zmq.utils.monitor import parse_monitor_message

from denseface.service.errors import AddressError, KeyFileError
from denseface.service.monitoring import Counters, Rejections
from denseface.service.protocol.roles import Role
from denseface.service.runtime.limits import MemoryWatch
from denseface.service.security import KeyPair, allow, new_pair, read_pair, read_public, revoke
from denseface.service.settings import ServiceSettings
from denseface.service.transport._descriptor_guard import DescriptorGuard
from denseface.service.transport.connection import Credentials, connect
from denseface.service.transport.listener import Listener
from denseface.service.transport.listeners import Listeners
from tests.ports import free_port
from tests.waiting import LIMIT_MS, LIMIT_S


class _Never:
    """Wakes no poll."""

    def __init__(self):
        self.ends = socket.socketpair()

    def fileno(self):
        return self.ends[0].fileno()


@pytest.fixture
def context():
    with zmq.Context() as context:
        yield context


@pytest.fixture
def wakes():
    never = _Never()
    yield never
    for end in never.ends:
        end.close()


def _address(host="127.0.0.1"):
    return f"tcp://{f'[{host}]' if ':' in host else host}:{free_port(host)}"


def _until(listeners, true):
    deadline = time.monotonic() + LIMIT_S
    received = []
    while not true(received):
        assert time.monotonic() < deadline
        listeners.tick()
        received += listeners.receive(10)
    return received


def test_a_listener_on_the_other_loopback(context):
    try:
        address = _address("::1")
    except OSError:
        pytest.skip("this machine has no IPv6")
    listener = Listener(context, address, None, Rejections(Counters()))
    dealer, monitor = connect(context, zmq.DEALER, address, None)
    try:
        dealer.send(b"hello")
        assert listener.sockets[0].poll(LIMIT_MS)
        (incoming,) = listener.receive()
        assert incoming.parts == [b"hello"]
        assert incoming.sender.roles == frozenset(Role)
        assert listener.send(incoming.peer, [b"back"])
        assert dealer.poll(LIMIT_MS)
    finally:
        monitor.close()
        dealer.close()
        listener.close()


def test_who_has_gone_is_told_after_all_that_it_said(context, wakes):
    settings = ServiceSettings(address=_address())
    listeners = Listeners(context, settings, Rejections(Counters()), [wakes])
    other = zmq.Context()
    try:
        dealer = other.socket(zmq.DEALER)
        dealer.connect(settings.address)
        for number in range(40):  # more than are read in one go
            dealer.send(b"%d" % number)
        other.destroy(linger=LIMIT_MS)
        said = []
        while True:
            said += listeners.receive(LIMIT_MS)
            if gone := [*listeners.take_gone()]:
                break
        assert [one.parts[0] for one in said] == [b"%d" % number for number in range(40)]
        assert gone == [(said[0].peer, True)]
        assert [*listeners.take_gone()] == []
    finally:
        listeners.close()


def test_an_address_in_use_is_named(context):
    address = _address()
    listener = Listener(context, address, None, Rejections(Counters()))
    with pytest.raises(AddressError, match=rf"^{address}: Address already in use$"):
        Listener(context, address, None, Rejections(Counters()))
    listener.close()


def test_who_was_refused_connects_once_allowed(context, wakes, tmp_path, monkeypatch):
    """After a refusal libzmq alone would never connect again."""
    monkeypatch.setattr("denseface.service.transport.connection._RECONNECT_S", 0.1)
    _, hub_key = new_pair(tmp_path, "hub")
    secret, public = new_pair(tmp_path, "late")
    allow(tmp_path, "other", KeyPair.generate().public, frozenset({Role.WORKER}))
    address, rejections = _address(), Rejections(Counters())
    settings = ServiceSettings(address=address, key=secret, hub_key=hub_key)
    hub_settings = ServiceSettings(address=_address(), listen=(address,), keys=tmp_path)
    listeners = Listeners(context, hub_settings, rejections, [wakes])
    dealer, monitor = connect(context, zmq.DEALER, address, Credentials.of(settings))
    try:
        _until(listeners, lambda _: monitor.read() or monitor.refused)
        assert "the hub refuses this key" in str(monitor.refused)
        assert rejections.counts()["unknown key"] >= 1
        one = allow(tmp_path, "late", read_public(public), frozenset({Role.WORKER}))
        _until(listeners, lambda _: monitor.read() or not monitor.refused)
        dealer.send(b"hello")
        (incoming,) = _until(listeners, lambda received: received)
        assert (incoming.sender, incoming.key) == (one, one.fingerprint)
        assert listeners.is_allowed(incoming.peer)
        assert listeners.send(incoming.peer, [b"back"])
        revoke(tmp_path, "late")
        assert listeners.tick()
        assert not listeners.is_allowed(incoming.peer)
        assert not listeners.send(incoming.peer, [b"back"])
    finally:
        monitor.close()
        dealer.close(linger=0)
        listeners.close()


def test_a_hub_with_a_local_door_alone_has_its_limits_too(context, wakes, monkeypatch):
    address, rejections = _address(), Rejections(Counters())
    listeners = Listeners(context, ServiceSettings(address=address), rejections, [wakes])
    host, port = address.removeprefix("tcp://").split(":")
    dealer = context.socket(zmq.DEALER)
    monitor = dealer.get_monitor_socket(zmq.Event.DISCONNECTED)
    try:
        dealer.connect(address)
        dealer.send(b"hello")
        assert _until(listeners, lambda received: received)
        with socket.create_connection((host, int(port)), LIMIT_S) as silent:
            assert silent.recv(1), "libzmq says something at once, to a connection that is there"
            ended = iter([3])
            monkeypatch.setattr(DescriptorGuard, "take_ended", lambda _: next(ended, 0))
            _until(listeners, lambda _: rejections.counts().get("connections"))
            while silent.recv(4096):
                pass
        assert not monitor.poll(0)
        used = iter([1])
        monkeypatch.setattr(MemoryWatch, "over_limit", lambda _: next(used, 0))
        _until(listeners, lambda _: monitor.poll(0))
        assert rejections.counts()["memory"] == 1
        dealer.send(b"again")
        assert _until(listeners, lambda received: received)
    finally:
        dealer.disable_monitor()
        monitor.close()
        dealer.close(linger=0)
        listeners.close()


def test_of_many_that_say_nothing_the_oldest_are_ended(context, wakes, tmp_path, monkeypatch):
    monkeypatch.setattr("denseface.service.transport._bound_socket._SILENT_S", 0.0)
    monkeypatch.setattr("denseface.service.transport._bound_socket._MAX_SILENT", 2)
    _, hub_key = new_pair(tmp_path, "hub")
    secret, public = new_pair(tmp_path, "one")
    allow(tmp_path, "one", read_public(public), frozenset({Role.WORKER}))
    address = _address()
    settings = ServiceSettings(address=address, key=secret, hub_key=hub_key)
    hub_settings = ServiceSettings(address=_address(), listen=(address,), keys=tmp_path)
    listeners = Listeners(context, hub_settings, Rejections(Counters()), [wakes])
    keys = Credentials.of(settings)
    opened, ended = [], set()

    def has_ended(monitor):
        while monitor.poll(0):
            event = parse_monitor_message(monitor.recv_multipart())["event"]
            if event == zmq.Event.DISCONNECTED:
                ended.add(monitor)
        return monitor in ended

    try:
        for _ in range(5):
            dealer = context.socket(zmq.DEALER)
            keys.apply(dealer)
            monitor = dealer.get_monitor_socket(
                zmq.Event.HANDSHAKE_SUCCEEDED | zmq.Event.DISCONNECTED)
            opened.append((dealer, monitor))
            dealer.connect(address)
            _until(listeners, lambda _, one=monitor: one.poll(0))
            if len(opened) == 1:
                dealer.send(b"hello")
                assert _until(listeners, lambda received: received)
        # Of those that say nothing two are left at a time, and the first has spoken.
        _until(listeners, lambda _: all(has_ended(monitor) for _, monitor in opened[1:3]))
        assert not has_ended(opened[0][1])
    finally:
        for dealer, monitor in opened:
            dealer.disable_monitor()
            monitor.close()
            dealer.close(linger=0)
        listeners.close()


def test_of_a_flood_a_part_is_read_and_then_the_port_is_cut(
        context, wakes, tmp_path, monkeypatch):
    monkeypatch.setattr("denseface.service.transport.handshakes._MAX_EVENTS", 10)
    monkeypatch.setattr("denseface.service.transport.handshakes._MAX_BEHIND", 2)
    _, hub_key = new_pair(tmp_path, "hub")
    secret, public = new_pair(tmp_path, "one")
    allow(tmp_path, "one", read_public(public), frozenset({Role.WORKER}))
    address, rejections = _address(), Rejections(Counters())
    settings = ServiceSettings(address=address, key=secret, hub_key=hub_key)
    hub_settings = ServiceSettings(address=_address(), listen=(address,), keys=tmp_path)
    listeners = Listeners(context, hub_settings, rejections, [wakes])
    host, port = address.removeprefix("tcp://").split(":")
    for _ in range(100):
        socket.create_connection((host, int(port))).close()
    dealer, monitor = connect(context, zmq.DEALER, address, Credentials.of(settings))
    try:
        _until(listeners, lambda _: rejections.counts().get("connections"))

        def say_again(received):
            # As the clients do: until the other end knows that its connection was cut, what it
            # sends is lost with it.
            if dealer.poll(0, zmq.POLLOUT):
                dealer.send(b"hello")
            return received

        *_, incoming = _until(listeners, say_again)
        assert listeners.send(incoming.peer, [b"back"])
    finally:
        monitor.close()
        dealer.close(linger=0)
        listeners.close()


def test_keys_are_for_other_machines(tmp_path):
    secret, public = new_pair(tmp_path, "a")
    away = {"address": "tcp://10.0.0.1:5700"}
    assert Credentials.of(ServiceSettings(**away)) is None
    for half, missing in (({"key": secret}, "--hub-key"), ({"hub_key": public}, "--key")):
        with pytest.raises(KeyFileError, match=f"expected {missing} FILE"):
            Credentials.of(ServiceSettings(**away, **half))
    _, hub = new_pair(tmp_path, "hub")
    both = Credentials.of(ServiceSettings(**away, key=secret, hub_key=hub))
    assert (both.pair, both.hub) == (read_pair(secret), read_public(hub))
    for own, which in ((public, "public"), (read_pair(secret).secret, "secret")):
        with pytest.raises(KeyFileError, match=f"--hub-key is the {which} key of .*a.secret"):
            Credentials.of(ServiceSettings(**away, key=secret, hub_key=own))
    assert Credentials.of(ServiceSettings(address="ipc:///run/hub", key=secret)) is None
    pasted = "a//bcdefghijabcdefghijabcdefghijabcdefg/"  # no path: that would lose a slash
    assert Credentials.of(ServiceSettings(**away, key=secret, hub_key=pasted)).hub == pasted


@pytest.mark.parametrize("address", ["ipc:///run/x", "tcp://host", "tcp://0.0.0.0:70000"])
def test_only_a_port_can_be_guarded(context, wakes, address):
    with pytest.raises(AddressError, match=address):
        Listeners(context, ServiceSettings(address=_address(), listen=(address,)),
                 Rejections(Counters()), [wakes])


def test_several_addresses_come_with_commas():
    settings = ServiceSettings.of({"DENSEFACE_LISTEN": "tcp://10.0.0.1:1,tcp://10.0.0.2:2"})
    assert settings.listen == ("tcp://10.0.0.1:1", "tcp://10.0.0.2:2")
    assert ServiceSettings.of({"DENSEFACE_LISTEN": "x"}, listen=["y"]).listen == ("y",)


def test_memory_that_stays_with_the_process_is_said_once(monkeypatch, tmp_path):
    statm = tmp_path / "statm"
    statm.touch()
    monkeypatch.setattr("denseface.service.runtime.limits._STATM", statm)
    monkeypatch.setattr("denseface.service.runtime.limits._PAGE_BYTES", 1)
    watch = MemoryWatch(100)

    def over_limit(used):
        statm.write_text(f"1000 {used} 3 4")
        return watch.over_limit()

    assert [over_limit(used) for used in (50, 120, 110, 130, 140, 150)] == [0, 120, 0, 0, 140, 0]
    assert [over_limit(used) for used in (50, 120)] == [0, 120]
    assert not watch.cut_was_too_little
    assert over_limit(119) == 0
    assert watch.cut_was_too_little
    assert over_limit(119) == 0
    assert not watch.cut_was_too_little
    watch.close()
