"""The cache of one kernel: reads from every folder that can be trusted, writes to the first.

numba's own reads from the first folder alone that it can write, believes every folder, and passes
on what a full disk or a damaged file raises.
"""

import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core import compiler, serialize
from numba.core.caching import _Cache

from denseface.files import read_bounded, write_whole
from denseface.recon.numerics.compilation.fingerprint import fingerprint, short_hash
from denseface.recon.numerics.compilation.folders import (
    folders_for,
    why_not_trusted,
    why_not_writable,
)
from denseface.recon.numerics.compilation.progress import Compiling, compiling

__all__ = ["KernelCache", "folder_to_write"]

_MAX_BYTES = 32 * 1024 * 1024
"""Longest file that is read, bytes; the longest that is written has 0.3 MB."""
_NO_BRACKETS = str.maketrans("", "", "<>")
"""Takes away what `<locals>` would bring into a file's name."""
_dumps: Any = serialize.dumps
_rebuild: Any = compiler.CompileResult._rebuild


class KernelCache(_Cache):
    """The compiled code of one function: a file for each types of arguments and processor."""

    def __init__(self, function: Callable[..., Any], turns: Compiling = compiling) -> None:
        self._function = function
        self._turns = turns
        self._source = Path(function.__code__.co_filename).absolute()
        self._enabled = self._source.is_file()
        self._prefix = ""

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
        target_context.refresh()
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
            key = sig, data.codegen.magic_tuple()
            not_kept = self._save(self._file_name(key), _dumps((key, data._reduce())))
        self._turns.end_one(not_kept)

    def _load(self, key: Any, target_context: Any) -> Any:
        if not self._enabled:
            return None
        name = self._file_name(key)
        for folder in folders_for(self._source):
            # Damaged, gone by now, or not to be looked at: it is compiled again.
            with suppress(Exception):
                if not (folder / name).exists() or why_not_trusted(
                        folder, self._source, folder / name):
                    continue
                kept, reduced = pickle.loads(  # noqa: S301 - nobody else can have written it
                    read_bounded(folder / name, _MAX_BYTES))
                if kept == key:
                    code = _rebuild(target_context, *reduced)
                    self._turns.folders.add(folder)
                    return code
        return None

    def _save(self, name: str, code: bytes) -> str:
        reasons = []
        for folder in folders_for(self._source):
            reason = why_not_writable(folder, self._source)
            if not reason:
                try:
                    write_whole(folder / name, [code], mode=0o644, synced=False)
                except OSError as error:
                    reason = f"{folder}: {error.strerror}"
                else:
                    self._remove_older(folder, name)
                    self._turns.folders.add(folder)
                    return ""
            reasons.append(reason)
        return "; ".join(reasons)

    def _file_name(self, key: Any) -> str:
        return f"{self._prefix_now()}{short_hash(str(key))}.nbc"

    def _prefix_now(self) -> str:
        """Give what the names begin with; known when all that the function calls is there."""
        if not self._prefix:
            function = f"{self._source.stem}.{self._function.__qualname__}".translate(_NO_BRACKETS)
            self._prefix = (f"{function}.{sys.implementation.cache_tag}-"
                            f"{fingerprint(self._function)}-")
        return self._prefix

    def _remove_older(self, folder: Path, name: str) -> None:
        """Remove the code of earlier versions of this function."""
        function = name[:name.index("-") + 1]
        with suppress(OSError):
            for one in folder.iterdir():
                if one.name.startswith(function) and not one.name.startswith(self._prefix_now()):
                    one.unlink(missing_ok=True)


def folder_to_write() -> Path | None:
    """Give the folder for this module's own code, where all processes of an installation meet."""
    source = Path(__file__).absolute()
    for folder in folders_for(source):
        if not why_not_writable(folder, source):
            return folder
    return None
