"""CURVE keys in files of mode 0600, written by `denseface keys`.

`NAME.secret` holds a pair, `NAME.public` its public key for other machines, and `allowed/NAME` (see
`service.security._allow_list`) a public key that may connect.
"""

import re
import struct
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Self

import zmq
import zmq.utils.z85
from pydantic import BaseModel, ConfigDict, ValidationError

from denseface.service.errors import KeyFileError, reason_of
from denseface.service.runtime.files import private_folder, read_private_text, write_atomically

HUB_NAME = "hub"
"""Name of the hub's own pair of keys."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
"""Name of a key, and of its file."""
_OTHERS = 0o077
"""Mode bits that a file with a secret key may not have."""
_Z85 = re.compile(r"[0-9A-Za-z.\-:+=^!/*?&<>()\[\]{}@%$#]{40}")
"""32 bytes in Z85 (ZeroMQ RFC 32)."""


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    public_key: str
    secret_key: str | None = None


@dataclass(frozen=True)
class KeyPair:
    """A CURVE pair, each key 40 characters of Z85."""

    public: str
    secret: str

    @classmethod
    def generate(cls) -> Self:
        """Generate a new pair."""
        public, secret = zmq.curve_keypair()
        return cls(public.decode(), secret.decode())

    def __repr__(self) -> str:
        """Show the public key alone: the secret one may not reach a log."""
        return f"KeyPair({self.public!r})"


def fingerprint(public: str) -> str:
    """Give the first 16 hexadecimal digits of a public key's SHA-256."""
    return sha256(public.encode()).hexdigest()[:16]


def check_name(name: str) -> str:
    """Check a key's name and give it back; KeyFileError where it may not be a file's name."""
    if not _NAME.fullmatch(name):
        raise KeyFileError(f"key name {name!r}: expected letters, digits, - and _, at most 64")
    return name


def check_key(path: Path, key: str) -> str:
    """Check a key that a file held and give it back; KeyFileError where it is none."""
    if not _is_key(key):
        raise KeyFileError(f"{path}: its key is not 40 characters of Z85")
    return key


def _is_key(text: str) -> bool:
    if not _Z85.fullmatch(text):
        return False
    try:
        return len(zmq.utils.z85.decode(text)) == 32
    except struct.error:  # five characters can encode more than four bytes hold
        return False


def new_pair(folder: Path, name: str) -> tuple[Path, Path]:
    """Generate a pair and give the paths of its files, secret and public.

    Raises
    ------
    KeyFileError, SettingsError
        Where the name is in use, or the folder cannot be written.
    """
    private_folder(folder)
    secret, public = (folder / f"{check_name(name)}.{kind}" for kind in ("secret", "public"))
    for path in (secret, public):
        if path.exists():
            raise KeyFileError(f"{path}: exists; remove it or choose another name")
    pair = KeyPair.generate()
    write_key_file(secret, _File(name=name, public_key=pair.public, secret_key=pair.secret))
    try:
        write_key_file(public, _File(name=name, public_key=pair.public))
    except BaseException:
        with suppress(OSError):
            secret.unlink()  # else the name would be in use
        raise
    return secret, public


def write_key_file(path: Path, contents: BaseModel) -> None:
    """Write a key file of mode 0600 atomically; KeyFileError where it cannot be written."""
    text = contents.model_dump_json(indent=2, exclude_none=True) + "\n"
    try:
        write_atomically(path, [text.encode()], mode=0o600)
    except OSError as error:
        raise KeyFileError(f"{path}: {reason_of(error)}") from error


def read_pair(path: Path) -> KeyPair:
    """Read a pair.

    Raises
    ------
    KeyFileError
        Where it is none, or other users may read it.
    """
    file = _read(path, _OTHERS)
    if file.secret_key is None:
        raise KeyFileError(f"{path}: holds a public key, expected the file NAME.secret")
    check_key(path, file.secret_key)
    if zmq.curve_public(file.secret_key.encode()).decode() != file.public_key:
        raise KeyFileError(f"{path}: its public and its secret key do not belong together")
    return KeyPair(file.public_key, file.secret_key)


def read_public(given: Path | str) -> str:
    """Read a public key: the 40 characters themselves, or a file that holds it.

    Raises
    ------
    KeyFileError
        Where it is neither, or a file with a secret key: that one is given to nobody.
    """
    if _is_key(str(given)):
        return str(given)
    path = Path(given)
    if not path.exists():
        raise KeyFileError(f"{path}: no such file, nor a key: expected NAME.public, or the 40 "
                           "characters in it")
    file = _read(path, 0)
    if file.secret_key is not None:
        raise KeyFileError(f"{path}: holds a secret key, which stays where it is used: expected "
                           f"the file {path.with_suffix('.public').name} beside it")
    return check_key(path, file.public_key)


def check_public(folder: Path, key: str) -> None:
    """Refuse the secret half of a pair that has a file in `folder`: KeyFileError.

    The halves look alike; of another pair it cannot be told.
    """
    half = zmq.curve_public(key.encode()).decode()
    for path in sorted(folder.glob("*.public")) + sorted(folder.glob("*.secret")):
        try:
            known = _read(path, 0).public_key
        except KeyFileError:
            continue
        if known == half:
            raise KeyFileError(
                f"that is the secret key of {path.stem}, which stays where it is used: expected "
                f"its public one, {known}; who has seen the secret one may use it: "
                "make a new pair")


def _read(path: Path, forbidden: int) -> _File:
    try:
        return _File.model_validate_json(read_private_text(path, forbidden))
    except ValidationError as error:
        raise KeyFileError(f"{path}: not a key file of `denseface keys`") from error
