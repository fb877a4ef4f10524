"""The allow-list: the folder `allowed`, one file for each public key that may connect.

A file that cannot be read, or is malformed, keeps its key out.
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from denseface.service.errors import KeyFileError, first_error, reason_of
from denseface.service.protocol.roles import Role
from denseface.service.runtime.files import private_folder, read_private_text
from denseface.service.runtime.limits import OUT_OF_DESCRIPTORS
from denseface.service.security._keys import (
    check_key,
    check_name,
    check_public,
    fingerprint,
    write_key_file,
)

_WRITABLE_BY_OTHERS = 0o022
"""Mode bits that a file of the list may not have."""


@dataclass(frozen=True)
class AllowedKey:
    """A key that may connect."""

    name: str
    public: str
    roles: frozenset[Role]

    @property
    def fingerprint(self) -> str:
        """The key in 16 hexadecimal digits."""
        return fingerprint(self.public)

    @property
    def token(self) -> bytes:
        """Hash of the key and its roles, 8 bytes."""
        text = " ".join([self.public, *sorted(self.roles)])
        return sha256(text.encode()).digest()[:8]


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    public_key: str
    roles: tuple[Role, ...] = Field(min_length=1)


class AllowList:
    """The keys of one folder, as of the last `refresh`."""

    def __init__(self, keys: Path) -> None:
        self._folder = keys / "allowed"
        self._files: dict[str, tuple[int, ...]] | None = None
        self._folder_stat: tuple[int, ...] | None = None
        self._by_public: Mapping[str, AllowedKey] = {}
        self._tokens: frozenset[bytes] = frozenset()
        self.changes = 0
        """Times that `refresh` found another list."""
        import structlog  # which who only has keys need not load

        self._log = structlog.get_logger("keys")
        self.refresh()
        self.changes = 0

    def __len__(self) -> int:
        return len(self._by_public)

    def __iter__(self) -> Iterator[AllowedKey]:
        return iter(self._by_public.values())

    def get(self, public: str) -> AllowedKey | None:
        """Give an allowed key, None where it is not."""
        return self._by_public.get(public)

    def has_token(self, token: bytes) -> bool:
        """Whether a key is still allowed with the same roles."""
        return token in self._tokens

    def refresh_if_touched(self) -> bool:
        """Refresh where a file came, went or was replaced: one look at the folder, not at each.

        A file that is written in place, or in the same tick of the file system's clock as the last
        change, is seen by the next `refresh`.
        """
        return self._stat_folder() != self._folder_stat and self.refresh()

    def refresh(self) -> bool:
        """Read the folder again where its files changed; True where the list did."""
        self._folder_stat = self._stat_folder()  # before its files, so that no change is missed
        files = self._stat_files()
        if files == self._files:
            return False
        before, self._files = self._files, files
        found: dict[str, AllowedKey] = {}
        for name in sorted(files):
            try:
                one = _read(self._folder / name)
            except KeyFileError as error:
                if _out_of_descriptors(error.__cause__):
                    self._files = before
                    return False
                self._log.error("key refused", reason=str(error))
                continue
            other = found.setdefault(one.public, one)
            if other is not one:
                self._log.error("key refused", reason=f"{name}: the same key as {other.name}")
        changed = found != self._by_public
        self.changes += changed
        self._by_public = found
        self._tokens = frozenset(one.token for one in found.values())
        return changed

    def _stat_folder(self) -> tuple[int, ...] | None:
        """Give what changes when a name in the folder does; None where it cannot be read."""
        try:
            found = self._folder.stat()
        except OSError:
            return None
        return found.st_dev, found.st_ino, found.st_mtime_ns, found.st_ctime_ns

    def _stat_files(self) -> dict[str, tuple[int, ...]]:
        """Give the name of each file and what changes when the file does."""
        files: dict[str, tuple[int, ...]] = {}
        try:
            for path in self._folder.iterdir():
                if not path.name.startswith("."):
                    with suppress(FileNotFoundError):  # revoked meanwhile
                        files[path.name] = _stamp(path)
        except FileNotFoundError:
            return {}  # nobody was ever allowed
        except OSError as error:
            if _out_of_descriptors(error):  # a flood of connections must not revoke keys
                return self._files or {}
            self._log.error("allow-list unreadable, nobody may connect", reason=str(error))
            return {}
        return files


def allow(keys: Path, name: str, public: str, roles: frozenset[Role]) -> AllowedKey:
    """Allow a key with these roles, in place of those it had.

    Raises
    ------
    KeyFileError, SettingsError
        Where key or name is in use with another, the file cannot be written, or the key is the
        secret half of a pair that `keys` knows.
    """
    one = AllowedKey(check_name(name), public, roles)
    folder = private_folder(private_folder(keys) / "allowed")
    check_public(keys, public)
    for other in AllowList(keys):
        if (other.public == public) != (other.name == name):
            raise KeyFileError(
                f"{name}: that name or key is in use: {other.name} {other.fingerprint}; "
                f"`denseface keys revoke {other.name}` first")
    write_key_file(folder / name, _File(public_key=public, roles=tuple(sorted(roles))))
    return one


def revoke(keys: Path, name: str) -> None:
    """Allow a key no more; a running hub disconnects it at once.

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


def _stamp(path: Path) -> tuple[int, ...]:
    """Give what changes when a file does; nothing for one that reading is to refuse by name."""
    try:
        found = path.stat()
    except FileNotFoundError:
        raise
    except OSError:  # a loop of links
        return ()
    return found.st_ino, found.st_mode, found.st_mtime_ns, found.st_ctime_ns, found.st_size


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
