"""Whether a TLS certificate and its key can serve browsers now, found out before one connects."""

import ssl
from pathlib import Path

from denseface.files import read_bounded
from denseface.service.errors import SettingsError, reason_of

__all__ = ["tls_context"]

_MAX_BYTES = 2**20
"""Of a file of certificates or of a key."""
_WHEN = {9: "is not valid yet", 10: "has expired"}
"""OpenSSL's codes of verification, `X509_V_ERR_CERT_NOT_YET_VALID` and `..._HAS_EXPIRED`."""


def tls_context(certificate: Path, key: Path, name: str) -> ssl.SSLContext:
    """Give what a server speaks TLS with, TLS 1.2 or later.

    Parameters
    ----------
    certificate : PEM file of the certificate, its chain behind it
    key : PEM file of its secret key, without a password
    name : of the setting, for errors

    Raises
    ------
    SettingsError
        One line that names the setting and the file: it cannot be read, is no certificate or no
        key, the key is another certificate's, the certificate is not valid yet or no more.
    """
    for path in (certificate, key):
        try:
            read_bounded(path, _MAX_BYTES)
        except OSError as error:
            raise SettingsError(f"{name}: {path}: {reason_of(error)}") from error
    try:
        ssl.create_default_context(cafile=certificate)
    except ssl.SSLError as error:
        raise SettingsError(f"{name}: {certificate}: no certificate in PEM form") from error
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)

    def no_password() -> str:
        raise SettingsError(f"{name}: {key}: the key has a password, and nobody is there to be "
                            "asked for it")

    try:
        context.load_cert_chain(certificate, key, password=no_password)
    except ssl.SSLError as error:
        wrong = (f"the key is not that of {certificate}" if error.reason == "KEY_VALUES_MISMATCH"
                 else "no secret key in PEM form")
        raise SettingsError(f"{name}: {key}: {wrong}") from error
    if when := _WHEN.get(_verified(context, certificate)):
        raise SettingsError(f"{name}: {certificate}: the certificate {when}")
    return context


def _verified(server: ssl.SSLContext, certificate: Path) -> int:
    """Let a client in this process look at the certificate; give OpenSSL's code, or 0.

    The client trusts it as it is: who has signed it is the browsers' business.
    """
    client = ssl.create_default_context(cafile=certificate)
    client.check_hostname = False
    client.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = (client.wrap_bio(to_client, to_server),
            server.wrap_bio(to_server, to_client, server_side=True))
    for _ in range(4):  # flights of a handshake: two each way
        for end in ends:
            try:
                end.do_handshake()
            except ssl.SSLWantReadError:
                continue
            except ssl.SSLCertVerificationError as error:
                return error.verify_code
            except ssl.SSLError:  # not of the certificate's dates
                return 0
    return 0
