"""By which address others on the network reach this machine: looked up when a link is made."""

import re
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path

import psutil

__all__ = ["Interface", "best_address", "interfaces", "own_addresses", "url_host"]

_CONTAINERS = re.compile(
    r"(docker|br-|veth|virbr|vnet|lxc|lxd|cni|flannel|cali|podman|vmnet|vboxnet|kube)")
"""Beginnings of the names of what joins this machine with what runs on it."""
_TUNNELS = re.compile(r"(tun|tap|wg|ppp|tailscale|zt|utun)")
"""Of what leads through a network to another one, where no visitor's telephone is."""
_NOWHERE = (("192.0.2.1", socket.AF_INET), ("2001:db8::1", socket.AF_INET6))
"""Addresses of documentation (RFC 5737, RFC 3849): a route to them is the default route."""


@dataclass(frozen=True)
class Interface:
    """One address of a network interface."""

    name: str
    address: IPv4Address | IPv6Address
    up: bool = True
    physical: bool = True
    """There is a device behind it."""
    default: bool = False
    """What leaves for elsewhere leaves from this address."""


def best_address(found: Iterable[Interface]) -> IPv4Address | IPv6Address | None:
    """Choose the address that a visitor's telephone most likely reaches; None where there is none.

    Real interfaces before tunnels before those of containers, then the one with the default route,
    then IPv4.
    """
    usable = [one for one in found if one.up and not one.address.is_loopback
              and not one.address.is_link_local and not one.address.is_multicast
              and not one.address.is_unspecified]
    best = min(usable, key=_rank, default=None)
    return best.address if best else None


def _rank(one: Interface) -> tuple[int, bool, bool, bool, str, str]:
    far = 2 if _CONTAINERS.match(one.name) else 1 if _TUNNELS.match(one.name) else 0
    return (far, not one.default, not one.physical, one.address.version == 6, one.name,
            str(one.address))


def interfaces() -> list[Interface]:
    """List the addresses of this machine's network interfaces as they are now."""
    stats = psutil.net_if_stats()
    defaults = {_route(*nowhere) for nowhere in _NOWHERE}
    found = []
    for name, addresses in psutil.net_if_addrs().items():
        for one in addresses:
            if one.family not in (socket.AF_INET, socket.AF_INET6):
                continue
            try:
                address = ip_address(one.address.partition("%")[0])
            except ValueError:
                continue
            found.append(Interface(
                name, address, up=name in stats and stats[name].isup,
                physical=(Path("/sys/class/net") / name / "device").exists(),
                default=str(address) in defaults))
    return found


def own_addresses() -> frozenset[str]:
    """List the addresses by which this machine may be named in a URL, as `url_host` writes them."""
    return frozenset(url_host(one.address) for one in interfaces())


def url_host(address: IPv4Address | IPv6Address) -> str:
    """Write an address as a URL has it: IPv6 in brackets."""
    return f"[{address}]" if address.version == 6 else str(address)


def _route(address: str, family: socket.AddressFamily) -> str | None:
    """Ask the system from which address it would leave for another; nothing is sent."""
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((address, 9))
            return str(probe.getsockname()[0])
    except OSError:
        return None
