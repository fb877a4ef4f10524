"""Addresses of the hub: its own, and the one for publications that follows from it.

Every function raises AddressError where the address is neither `ipc://` nor `tcp://`, or its path
or port is impossible.
"""

import socket
import stat
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

from denseface.service.errors import AddressError, HubRunningError, reason_of
from denseface.service.runtime.files import check_unwritable, socket_folder
from denseface.service.settings import runtime_folder
from denseface.service.transport.absence import check_openable

_PUBLICATIONS = ".publications"
"""Ending of the socket file for publications."""
_MAX_SOCKET_PATH = 107 - len(_PUBLICATIONS)
"""Longest path of a socket file, bytes: `sun_path` of unix(7) holds 108, the last is NUL."""


def socket_file(address: str) -> Path | None:
    """Give the file of an `ipc://` address, None for `tcp://`."""
    if address.startswith("ipc://"):
        path = Path(address.removeprefix("ipc://"))
        if not path.is_absolute() or len(str(path)) > _MAX_SOCKET_PATH:
            raise AddressError(
                f"{address}: an ipc address is ipc:// and an absolute path of at most "
                f"{_MAX_SOCKET_PATH} bytes")
        return path
    _host_and_port(address)
    return None


def publications_of(address: str) -> str:
    """Give where the hub of this address publishes: the next port, or the file beside."""
    if socket_file(address):
        return address + _PUBLICATIONS
    host, port = _host_and_port(address)
    return f"tcp://{f'[{host}]' if ':' in host else host}:{port + 1}"


def is_local(address: str) -> bool:
    """Say whether only this machine reaches an address: `ipc`, or a loopback TCP address."""
    if socket_file(address):
        return True
    try:
        return ip_address(_host_and_port(address)[0]).is_loopback
    except ValueError:
        return False


def check_bindable(address: str) -> None:
    """Make the folder of an `ipc` address, or check that nobody else may put a socket there.

    SettingsError where somebody may, or where something else has its name; HubRunningError where
    another hub answers there: binding would silently take its place.
    """
    if path := socket_file(address):
        check_socket_file(path)
        _check_replaceable(path.with_name(path.name + _PUBLICATIONS))


def check_socket_file(path: Path) -> None:
    """Make the folder of a socket's file; HubRunningError where another hub answers there.

    SettingsError where the folder cannot be had, or something else has that name.
    """
    socket_folder(path.parent)
    _check_replaceable(path)
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return
    raise HubRunningError(f"ipc://{path}: another hub is listening there")


def _check_replaceable(path: Path) -> None:
    """Refuse a name that something else than a socket has: libzmq would remove that."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    except OSError as error:
        raise AddressError(f"ipc://{path}: {reason_of(error)}") from error
    if not stat.S_ISSOCK(mode):
        raise AddressError(f"ipc://{path}: there is a file of that name, and it is no socket")


def check_connectable(address: str) -> None:
    """Refuse a malformed address, and one where anybody else might be the hub, and receive faces.

    So is a socket's file that this user may not open. The folder of the default address is made if
    it is missing: in a shared temporary folder anyone else could make it. SettingsError where it is
    not this user's, or anybody may write there.
    """
    path = socket_file(address)
    if path and path.parent == runtime_folder():
        socket_folder(path.parent)
    elif path:
        check_openable(address, path)
        if path.parent.exists():
            check_unwritable(path.parent, stat.S_IWOTH)


def _host_and_port(address: str) -> tuple[str, int]:
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    # The next port is for publications.
    if not host or not port or port == 65535 or address.partition("://")[0] != "tcp" or parts.path:
        raise AddressError(f"{address}: expected ipc://PATH or tcp://HOST:PORT")
    return host, port
