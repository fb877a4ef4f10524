"""What was compiled once is found again wherever that is safe, and nothing stops a kernel."""

import errno
import importlib.util
import logging
import os
import re

import numba
import pytest
from numba.core.registry import cpu_target

from denseface.recon.numerics.compilation import _rebuild, cache, fingerprint
from denseface.recon.numerics.compilation.cache import KernelCache
from denseface.recon.numerics.compilation.progress import LOGGER, Compiling

SOURCE = """
FACTOR = 2
def scaled(x):
    return FACTOR * x
"""


@pytest.fixture(autouse=True)
def only_these_folders(tmp_path, monkeypatch):
    """A package, a user's cache folder and a folder for temporary files, and no other."""
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", "")
    for variable, name in (("XDG_CACHE_HOME", "home/.cache"), ("TMPDIR", "tmp")):
        monkeypatch.setenv(variable, str(tmp_path / name))
    for name in ("package", "home", "tmp"):
        (tmp_path / name).mkdir()
    (tmp_path / "package" / "kernels.py").write_text(SOURCE)
    monkeypatch.setattr(cache, "__file__", str(tmp_path / "package" / "kernels.py"))


def imported(path):
    """Import a file anew."""
    fingerprint._file_hash.cache_clear()
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def start(tmp_path):
    """Start anew: give what calls the kernel, and says whether it had to be compiled."""
    def started(value=2):
        module = imported(tmp_path / "package" / "kernels.py")
        kernel = numba.njit(module.scaled)
        turns = Compiling()
        kernel._cache = KernelCache(module.scaled, turns)
        turns.add(kernel)
        with turns.session():
            assert kernel(value) == module.FACTOR * value
        return bool(kernel.stats.cache_misses)

    return started


@pytest.fixture
def said(caplog, monkeypatch):
    monkeypatch.setattr(logging.getLogger(LOGGER), "propagate", True)
    caplog.set_level(logging.INFO, LOGGER)
    return lambda: [re.sub(r"after \d+ s", "after 0 s", record.getMessage())
                    for record in caplog.records if record.name == LOGGER]


def kept(folder):
    return sorted(folder.rglob("*.nbc"))


def cannot_be_written(folder, monkeypatch):
    """As for a user without the right: root has it whatever the mode is."""
    allowed = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: (
        folder not in (path, *path.parents) and allowed(path, mode)))


def test_it_is_compiled_once_and_kept_beside_its_source(start, tmp_path, said):
    assert start()
    assert [one.parent.name for one in kept(tmp_path)] == ["__pycache__"]
    assert said() == ["compiling kernels, once on this machine: 0 of 1",
                      "compiling kernels, once on this machine: 1 of 1",
                      "kernels ready after 0 s"]
    assert not start()
    assert len(said()) == 3
    assert start(2.5), "of another type"


def test_what_a_read_only_installation_brings_is_used(start, tmp_path, monkeypatch):
    start()
    cannot_be_written(tmp_path / "package", monkeypatch)
    monkeypatch.setenv("XDG_CACHE_HOME", "/nonexistent/.cache")
    assert not start()


def test_else_it_is_kept_in_a_folder_of_the_user(start, tmp_path, monkeypatch):
    cannot_be_written(tmp_path / "package", monkeypatch)
    assert start()
    assert not start()
    assert kept(tmp_path / "home" / ".cache" / "denseface")
    assert (tmp_path / "home" / ".cache" / "denseface").stat().st_mode & 0o777 == 0o700


def test_without_a_home_it_is_kept_in_a_private_folder_for_temporary_files(
        start, tmp_path, monkeypatch):
    cannot_be_written(tmp_path / "package", monkeypatch)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "no home" / ".cache"))
    assert start()
    assert not start()
    assert [one.stat().st_mode & 0o777 for one in (tmp_path / "tmp").iterdir()] == [0o700]
    assert not (tmp_path / "no home").exists()


def test_where_nothing_can_be_kept_that_is_said_once_with_what_to_do(
        start, tmp_path, monkeypatch, said):
    cannot_be_written(tmp_path, monkeypatch)
    assert start()
    assert said()[-1].startswith(
        "kernels ready after 0 s, for this start alone: compiled kernels can be kept nowhere; set "
        "NUMBA_CACHE_DIR to a folder that only you can write ("
        f"{tmp_path}/package/__pycache__ cannot be written; ")
    assert start()


def test_the_folder_that_is_named_comes_first(start, tmp_path, monkeypatch):
    (tmp_path / "named").mkdir()
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "named"))
    start()
    assert kept(tmp_path) == kept(tmp_path / "named") != []


def test_what_others_can_write_is_not_run(start, tmp_path):
    start()
    kept(tmp_path)[0].chmod(0o666)
    assert start()
    assert not start(), "it was replaced"


def test_a_folder_that_others_can_write_is_left_alone(start, tmp_path):
    start()
    (tmp_path / "package" / "__pycache__").chmod(0o777)
    assert start()
    assert not start()
    assert kept(tmp_path / "home")


@pytest.mark.parametrize("damage", [b"", b"\x80", b"no pickle"])
def test_a_damaged_file_is_compiled_again(start, tmp_path, damage):
    start()
    one, = kept(tmp_path)
    one.write_bytes(damage)
    assert start()
    assert not start()


def test_a_full_disk_stops_no_kernel(start, tmp_path, monkeypatch, said):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr(cache, "write_whole", full)
    assert start()
    assert "__pycache__: No space left on device" in said()[-1]


def test_other_code_is_compiled_again_and_takes_the_place_of_the_old(start, tmp_path):
    start()
    old = kept(tmp_path)
    (tmp_path / "package" / "kernels.py").write_text(SOURCE.replace("2", "3"))
    assert start()
    assert len(kept(tmp_path)) == 1
    assert kept(tmp_path) != old


def test_a_kernel_follows_what_it_calls_in_another_file(tmp_path):
    (tmp_path / "caller.py").write_text("def caller(x):\n    return callee(x)\n")
    marks = []
    for text in ("2 * x", "3 * x"):
        (tmp_path / "callee.py").write_text(f"def callee(x):\n    return {text}\n")
        module = imported(tmp_path / "caller.py")
        module.callee = numba.njit(imported(tmp_path / "callee.py").callee)
        marks.append(fingerprint.fingerprint(module.caller))
    assert marks[0] != marks[1]


def test_what_is_kept_is_loaded_without_readying_the_compiler(start, monkeypatch):
    start()
    for what in ("refresh", "load_additional_registries"):
        monkeypatch.setattr(cpu_target.target_context, what, None)
    assert not start()


def test_a_kernel_compiled_later_takes_in_one_that_was_loaded(start, tmp_path):
    start()
    module = imported(tmp_path / "package" / "kernels.py")
    loaded = numba.njit(module.scaled)
    loaded._cache = KernelCache(module.scaled, Compiling())

    @numba.njit
    def twice(x):
        return loaded(loaded(x))

    loaded(5)
    (code,) = loaded.overloads.values()
    assert code.library._shared_module is None  # not read before it is needed
    assert twice(5) == 20
    assert not loaded.stats.cache_misses


def test_constants_come_without_the_module_of_the_function_that_they_are_of():
    kept = _rebuild._environment("nowhere.to.be.found", ["too few"], "of a test")
    assert kept.consts == ["too few"]
    assert kept is _rebuild._environment("nowhere.to.be.found", [], "of a test")
