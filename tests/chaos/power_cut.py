"""A disk whose power can be cut: what is on it then, of the file operations that a log names.

It is as hostile as POSIX allows: a file's contents are safe after a sync of the file, its name
after a sync of the folder. Folders themselves are safe at once, as one journal holds them all.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["VARIANTS", "Disk", "Record", "read_log"]

VARIANTS = ("all that was not synced is lost", "names are kept, contents lost", "all is kept")
"""The last is as if the process had been killed."""
_PAGE = 4096
"""Of the kernel's cache, bytes."""
_SYNCS = ("fsync", "fdatasync")


@dataclass(frozen=True)
class Record:
    """A file operation, or a mark."""

    kind: str
    position: int
    """Its number among all operations; of a mark, that of the operation before."""
    descriptor: int
    value: int
    """Offset, size, or for `open` 1 where it truncates."""
    path: str
    """Below the folder; the text of a mark; the name of an operation that failed."""
    other: str
    data: bytes

    def __str__(self) -> str:
        return " ".join(filter(None, [self.kind, self.path, self.other]))


def read_log(log: Path, folder: Path) -> Iterator[Record]:
    """Read what `disk_faults.c` wrote down."""
    content, at = log.read_bytes(), 0
    paths: dict[int, str] = {}
    while at < len(content):
        end = content.index(b"\n", at)
        kind, position, descriptor, value, size, path, other = content[at:end].decode().split("\t")
        at = end + 1 + int(size)
        number = int(descriptor)
        if kind == "open":
            paths[number] = path
        if kind not in ("mark", "failed"):
            path = path or paths.get(number, "")
            path, other = (one and str(Path(one).relative_to(folder)) for one in (path, other))
        yield Record(
            kind, int(position), number, int(value), path, other, content[end + 1:at])


@dataclass
class _File:
    data: bytearray = field(default_factory=bytearray)
    safe: bytearray = field(default_factory=bytearray)
    dirty: set[int] = field(default_factory=set)
    """Pages that are to be written to the disk."""

    def write(self, at: int, data: bytes) -> None:
        self.resize(max(len(self.data), at + len(data)))
        self.data[at:at + len(data)] = data
        self.dirty |= set(range(at // _PAGE, -(-(at + len(data)) // _PAGE)))

    def resize(self, size: int) -> None:
        del self.data[size:]
        self.data.extend(bytes(size - len(self.data)))

    def sync(self) -> None:
        del self.safe[len(self.data):]
        self.safe.extend(bytes(len(self.data) - len(self.safe)))
        for page in self.dirty:
            here = slice(page * _PAGE, (page + 1) * _PAGE)
            self.safe[here] = self.data[here]
        self.dirty.clear()


class Disk:
    """Files by their names, and what of both is safe."""

    def __init__(self) -> None:
        self._names: dict[str, _File] = {}
        self._safe_names: dict[str, _File] = {}
        self._open: dict[int, _File | str] = {}
        """By descriptor: a file, or a folder's path."""
        self._folders = {"."}

    def do(self, record: Record) -> None:
        """Do one operation."""
        file = self._open.get(record.descriptor)
        match record.kind:
            case "mkdir":
                self._folders.add(record.path)
            case "open" if record.path in self._folders:
                self._open[record.descriptor] = record.path
            case "open":
                opened = self._names.setdefault(record.path, _File())
                self._open[record.descriptor] = opened
                if record.value:
                    opened.resize(0)
            case "write" if isinstance(file, _File):
                file.write(record.value, record.data)
            case "truncate" if isinstance(file, _File):
                file.resize(record.value)
            case "sync" if isinstance(file, _File):
                file.sync()
            case "failed" if record.path in _SYNCS and isinstance(file, _File):
                file.dirty.clear()  # Linux reports a failure once, and writes these no more
            case "sync" if isinstance(file, str):
                for names in (self._safe_names, self._names):
                    here = {name: one for name, one in names.items()
                            if str(Path(name).parent) == file}
                    if names is self._safe_names:
                        for name in here:
                            del self._safe_names[name]
                    else:
                        self._safe_names |= here
            case "rename":
                self._names[record.other] = self._names.pop(record.path)
            case "link":
                self._names[record.other] = self._names[record.path]
            case "unlink":
                self._names.pop(record.path, None)

    def write_to(self, folder: Path, variant: str) -> None:
        """Make the folder as it is after a power cut."""
        for name in sorted(self._folders):
            (folder / name).mkdir(mode=0o700, parents=True, exist_ok=True)
        names = self._safe_names if variant == VARIANTS[0] else self._names
        for name, file in names.items():
            if not name.endswith("-shm"):  # of this start of the machine
                (folder / name).write_bytes(file.data if variant == VARIANTS[2] else file.safe)
