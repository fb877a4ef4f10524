"""The operator's token: made at the first start, shown once, kept as its hash."""

import hashlib
import hmac
import secrets
from pathlib import Path

from denseface.files import read_bounded
from denseface.service.errors import SettingsError, reason_of
from denseface.service.runtime.files import private_folder, write_atomically

__all__ = ["OperatorToken"]

_FILE = "operator-token.sha256"
"""In the kiosk's folder."""
_MODE = 0o600
_OTHERS = 0o077
_ALPHABET = "abcdefghjkmnpqrstuvwxyz23456789"
"""Letters and digits that are not taken for one another."""
_GROUPS, _GROUP = 7, 4
"""28 characters of 31: 138 bits. So much need not be hashed slowly."""
_MAX_BYTES = 200


class OperatorToken:
    """The token of one kiosk.

    Parameters
    ----------
    folder : the kiosk's own, which is created
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.path = folder / _FILE

    def ensure(self) -> str | None:
        """Make a token where there is none, and give it: nobody can read it later.

        Raises
        ------
        SettingsError
            The folder or the file cannot be used.
        """
        if self.path.exists():
            self.digest()
            return None
        return self.renew()

    def renew(self) -> str:
        """Make a token in the place of the one before, whose sessions end; raises as `ensure`."""
        private_folder(self._folder)
        token = "-".join("".join(secrets.choice(_ALPHABET) for _ in range(_GROUP))
                         for _ in range(_GROUPS))
        try:
            write_atomically(self.path, [_digest(token).encode() + b"\n"], mode=_MODE)
        except OSError as error:
            raise SettingsError(f"{self.path}: {reason_of(error)}") from error
        return token

    def digest(self) -> str:
        """Give the hash of the token as it is now.

        Raises
        ------
        SettingsError
            The file is missing, open to others or no hash.
        """
        try:
            text = read_bounded(self.path, _MAX_BYTES).decode("ascii", "replace").strip()
            mode = self.path.stat().st_mode & 0o777
        except FileNotFoundError as error:
            raise SettingsError("there is no operator's token: denseface kiosk "
                                "--new-operator-token makes one") from error
        except OSError as error:
            raise SettingsError(f"{self.path}: {reason_of(error)}") from error
        if mode & _OTHERS:
            raise SettingsError(f"{self.path}: others may use the operator's token (mode {mode:o}):"
                                " make another with denseface kiosk --new-operator-token")
        if len(text) != hashlib.sha256().digest_size * 2 or set(text) - set("0123456789abcdef"):
            raise SettingsError(f"{self.path}: not the hash of a token: make another with "
                                "denseface kiosk --new-operator-token")
        return text

    def fits(self, given: str) -> bool:
        """Say whether this is the token, however it was typed; raises as `digest`."""
        return hmac.compare_digest(_digest(given), self.digest())


def _digest(token: str) -> str:
    plain = "".join(token.split()).replace("-", "").lower()
    return hashlib.sha256(plain.encode(errors="surrogatepass")).hexdigest()
