"""Who may come in: the folder `allowed`, one file for each public key, looked at again and again.

Whatever is wrong with a file keeps its key out, never in.
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import structlog
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from denseface.service.errors import KeyFileError, first_error, reason_of
from denseface.service.protocol.roles import Role
from denseface.service.runtime.files import private_folder, read_private_text
from denseface.service.runtime.limits import OUT_OF_DESCRIPTORS
from denseface.service.security.keys import (
    check_key,
    check_name,
    fingerprint,
    write_key_file,
)

__all__ = ["AllowList", "AllowedKey", "allow", "revoke"]

_WRITABLE_BY_OTHERS = 0o022


@dataclass(frozen=True)
class AllowedKey:
    """A key that may come in."""

    name: str
    public: str
    roles: frozenset[Role]

    @property
    def fingerprint(self) -> str:
        """The key in 16 hexadecimal digits."""
        return fingerprint(self.public)

    @property
    def token(self) -> bytes:
        """The key with its roles in 8 bytes: other roles make another."""
        text = " ".join([self.public, *sorted(self.roles)])
        return sha256(text.encode()).digest()[:8]


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    public_key: str
    roles: tuple[Role, ...] = Field(min_length=1)


class AllowList:
    """The keys of one folder, as they are now."""

    def __init__(self, keys: Path) -> None:
        self._folder = keys / "allowed"
        self._seen: dict[str, tuple[int, ...]] | None = None
        self._by_public: Mapping[str, AllowedKey] = {}
        self._tokens: frozenset[bytes] = frozenset()
        self.changes = 0
        """How often the list has changed since it was first read."""
        self._log = structlog.get_logger("keys")
        self.refresh()
        self.changes = 0

    def __len__(self) -> int:
        return len(self._by_public)

    def __iter__(self) -> Iterator[AllowedKey]:
        return iter(self._by_public.values())

    def get(self, public: str) -> AllowedKey | None:
        """Give what a key is allowed, None where it is not."""
        return self._by_public.get(public)

    def has_token(self, token: bytes) -> bool:
        """Say whether a key is still allowed, with the same roles."""
        return token in self._tokens

    def refresh(self) -> bool:
        """Look at the folder; True where anything changed."""
        seen = self._look()
        if seen == self._seen:
            return False
        before, self._seen = self._seen, seen
        found: dict[str, AllowedKey] = {}
        for name in sorted(seen):
            try:
                one = _read(self._folder / name)
            except KeyFileError as error:
                if _out_of_descriptors(error.__cause__):
                    self._seen = before
                    return False
                self._log.error("key not let in", reason=str(error))
                continue
            first = found.setdefault(one.public, one)
            if first is not one:
                self._log.error("key not let in", reason=f"{name}: the same key as {first.name}")
        changed = found != self._by_public
        self.changes += changed
        self._by_public = found
        self._tokens = frozenset(one.token for one in found.values())
        return changed

    def _look(self) -> dict[str, tuple[int, ...]]:
        seen: dict[str, tuple[int, ...]] = {}
        try:
            for path in self._folder.iterdir():
                with suppress(FileNotFoundError):  # revoked meanwhile
                    found = path.stat()
                    if not path.name.startswith("."):
                        seen[path.name] = (found.st_ino, found.st_mtime_ns, found.st_ctime_ns,
                                           found.st_size)
        except FileNotFoundError:
            return {}  # nobody was ever allowed
        except OSError as error:
            if _out_of_descriptors(error):  # a flood of connections may revoke nobody
                return self._seen or {}
            self._log.error("allow-list unreadable, nobody is let in", reason=str(error))
            return {}
        return seen


def allow(keys: Path, name: str, public: str, roles: frozenset[Role]) -> AllowedKey:
    """Let a key in from now on, with these roles in place of those it had.

    Raises
    ------
    KeyFileError, SettingsError
        Where the key has another name already, the name another key, or it cannot be written.
    """
    one = AllowedKey(check_name(name), public, roles)
    folder = private_folder(private_folder(keys) / "allowed")
    for other in AllowList(keys):
        if (other.public == public) != (other.name == name):
            raise KeyFileError(
                f"{name}: that name or key is in use: {other.name} {other.fingerprint}; "
                f"`denseface keys revoke {other.name}` first")
    write_key_file(folder / name, _File(public_key=public, roles=tuple(sorted(roles))))
    return one


def revoke(keys: Path, name: str) -> None:
    """Let a key in no more; whoever uses it is cut off by a running hub at once.

    Raises
    ------
    KeyFileError
        Where no key of that name is allowed.
    """
    path = keys / "allowed" / check_name(name)
    try:
        path.unlink()
    except FileNotFoundError:
        raise KeyFileError(f"{name}: no key of that name is allowed in {path.parent}") from None
    except OSError as error:
        raise KeyFileError(f"{path}: {reason_of(error)}") from error


def _out_of_descriptors(error: BaseException | None) -> bool:
    return isinstance(error, OSError) and error.errno in OUT_OF_DESCRIPTORS


def _read(path: Path) -> AllowedKey:
    name = check_name(path.name)
    try:
        file = _File.model_validate_json(read_private_text(path, _WRITABLE_BY_OTHERS))
    except ValidationError as error:
        field, message = first_error(error)
        raise KeyFileError(f"{path}: {field or 'file'}: {message}") from error
    return AllowedKey(name, check_key(path, file.public_key), frozenset(file.roles))
