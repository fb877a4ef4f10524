"""The cache of one kernel: reads from every folder that can be trusted, writes to the first.

Its files are numba's. numba's own cache reads from the first folder alone that it can write,
believes every folder, and passes on what a full disk or a damaged file raises.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, cast

from numba.core.caching import IndexDataCacheFile, _Cache

from denseface.files import write_whole
from denseface.recon.numerics.compilation._rebuild import read, rebuild
from denseface.recon.numerics.compilation.fingerprint import fingerprint
from denseface.recon.numerics.compilation.folders import (
    folders_for,
    why_not_trusted,
    why_not_writable,
)
from denseface.recon.numerics.compilation.progress import Compiling, compiling

__all__ = ["KernelCache", "folder_to_write"]

_NO_BRACKETS = str.maketrans("", "", "<>")
"""Takes away what `<locals>` would bring into a file's name."""


class KernelCache(_Cache):
    """The compiled code of one function: a file for each types of arguments and processor."""

    def __init__(self, function: Callable[..., Any], turns: Compiling = compiling) -> None:
        self._function = function
        self._turns = turns
        self._source = Path(function.__code__.co_filename).absolute()
        self._enabled = self._source.is_file()
        name = f"{self._source.stem}.{function.__qualname__}".translate(_NO_BRACKETS)
        self._every_version = f"{name}.{sys.implementation.cache_tag}-"

    @property
    def cache_path(self) -> str:
        """The folder that is looked into first."""
        return str(next(folders_for(self._source)))

    def enable(self) -> None:
        """Use it."""
        self._enabled = True

    def disable(self) -> None:
        """Use it no more."""
        self._enabled = False

    def flush(self) -> None:
        """Keep what there is: it is found by all that it was made of."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Give the code for these types; None where this process is to compile it."""
        key = sig, target_context.codegen().magic_tuple()
        code = self._load(key, target_context)
        if code is None and self._turns.take_turn(folder_to_write):
            code = self._load(key, target_context)  # another process may have compiled it
            if code is not None:
                self._turns.give_turn()
        if code is None:
            self._turns.begin_one()
        return code

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep code in the first folder that can be written, or nowhere."""
        not_kept = ""
        if self._enabled and not data.library.has_dynamic_globals and not data.lifted:
            not_kept = self._save((sig, data.codegen.magic_tuple()), data._reduce())
        self._turns.end_one(not_kept)

    def _load(self, key: Any, target_context: Any) -> Any:
        if not self._enabled:
            return None
        for folder in folders_for(self._source):
            # Damaged, gone by now, or not to be looked at: it is compiled again.
            with suppress(Exception):
                reduced = self._files(folder).load_trusted(key, self._source)
                if reduced is not None:
                    code = rebuild(target_context, *reduced)
                    self._turns.folders.add(folder)
                    return code
        return None

    def _save(self, key: Any, code: Any) -> str:
        reasons = []
        for folder in folders_for(self._source):
            reason = why_not_writable(folder, self._source)
            if not reason:
                try:
                    self._write(folder, key, code)
                except OSError as error:
                    reason = f"{folder}: {error.strerror}"
                else:
                    self._turns.folders.add(folder)
                    return ""
            reasons.append(reason)
        return "; ".join(reasons)

    def _write(self, folder: Path, key: Any, code: Any) -> None:
        """Keep code beside what there is; what is damaged, not trusted or older, goes."""
        sound = False
        with suppress(Exception):
            if not self._doubt(folder):
                self._files(folder).load(key)
                sound = True
        if not sound:
            for one in self._kept(folder):
                one.unlink(missing_ok=True)
        self._files(folder).save(key, code)
        with suppress(OSError):
            for one in folder.glob(f"{self._every_version}*"):
                if not one.name.startswith(self._base):
                    one.unlink(missing_ok=True)

    def _doubt(self, folder: Path) -> str:
        """Say why what is kept in a folder is not to be run; empty where it may be."""
        return why_not_trusted(folder, self._source, *self._kept(folder))

    def _kept(self, folder: Path) -> list[Path]:
        return list(folder.glob(f"{self._base}.*"))

    @cached_property
    def _base(self) -> str:
        """Give what the files' names begin with; known when all that the function calls is."""
        return self._every_version + fingerprint(self._function)

    def _files(self, folder: Path) -> Any:
        new: Any = _Files  # numba has no types
        return new(str(folder), self._base, None)


class _Files(IndexDataCacheFile):
    """numba's index and files of one function: whole, and for no other user to write."""

    _index_path: str

    def load_trusted(self, key: Any, source: Path) -> Any:
        """Give what was kept; None where there is nothing, or it is not to be run."""
        index, untyped = Path(self._index_path), cast("Any", self)
        if why_not_trusted(index.parent, source, index):
            return None
        name = untyped._load_index().get(key)
        if name is None or why_not_trusted(index.parent, source, index.parent / name):
            return None
        return read(index.parent / name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BytesIO]:
        file = BytesIO()
        yield file
        write_whole(Path(filepath), [file.getvalue()], mode=0o644, synced=False)


def folder_to_write() -> Path | None:
    """Give the folder for this module's own code, where all processes of an installation meet."""
    source = Path(__file__).absolute()
    for folder in folders_for(source):
        if not why_not_writable(folder, source):
            return folder
    return None
