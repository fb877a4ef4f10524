"""Which address a link names."""

from ipaddress import ip_address

import pytest

from denseface.service.kiosk.links.addresses import (
    Interface,
    best_address,
    interfaces,
    own_addresses,
    url_host,
)


def one(name, address, **facts) -> Interface:
    return Interface(name, ip_address(address), **facts)


LO = one("lo", "127.0.0.1", physical=False)
DOCKER = one("docker0", "172.17.0.1", physical=False)
WIFI = one("wlp2s0", "192.168.1.20")


@pytest.mark.parametrize(("found", "address"), [
    ([LO], None),
    ([], None),
    ([LO, DOCKER, WIFI], "192.168.1.20"),
    ([LO, DOCKER], "172.17.0.1"),
    ([one("docker0", "172.17.0.1", physical=False, default=True), WIFI], "192.168.1.20"),
    ([one("br-0a1b", "172.18.0.1", physical=False), one("veth1", "10.9.0.1", physical=False),
      one("br0", "192.168.7.2", physical=False)], "192.168.7.2"),
    ([one("wg0", "10.8.0.2", physical=False, default=True), WIFI], "192.168.1.20"),
    ([one("eth0", "10.0.0.5"), one("eth1", "10.1.0.5", default=True)], "10.1.0.5"),
    ([one("eth0", "10.0.0.5", up=False), WIFI], "192.168.1.20"),
    ([one("eth0", "169.254.7.7"), WIFI], "192.168.1.20"),
    ([one("eth0", "fe80::1"), one("eth0", "fd00::5")], "fd00::5"),
    ([one("eth0", "fd00::5"), one("eth0", "10.0.0.5")], "10.0.0.5"),
    ([one("eth0", "fd00::5", default=True), one("eth0", "10.0.0.5", default=True)], "10.0.0.5"),
])
def test_the_network_of_the_room_comes_before_those_within_the_machine(found, address):
    best = best_address(found)
    assert (str(best) if best else None) == address
    best = best_address(reversed(found))
    assert (str(best) if best else None) == address


def test_an_ipv6_address_has_brackets_in_a_url():
    assert url_host(ip_address("fd00::5")) == "[fd00::5]"
    assert url_host(ip_address("10.0.0.5")) == "10.0.0.5"


def test_this_machine_has_a_loopback_that_is_up():
    found = interfaces()
    assert any(one.address.is_loopback and one.up and not one.physical for one in found)
    assert "127.0.0.1" in own_addresses()
