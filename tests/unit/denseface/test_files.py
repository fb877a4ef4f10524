"""Files from outside, and files that are whole or not there."""

import os
import socket

import pytest

from denseface.files import open_regular, read_bounded, replacing, replacing_by_name


def make(kind, path):
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(os.path.relpath(path))
    else:
        path.symlink_to(kind)
    return path


@pytest.mark.parametrize("kind", ["fifo", "folder", "socket", "/dev/zero", "/dev/full"])
def test_what_is_no_file_is_not_read(tmp_path, kind, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
    with pytest.raises(OSError, match=r"regular file|directory|No such device"):
        open_regular(make(kind, tmp_path / "input"))
    assert len(os.listdir("/proc/self/fd")) == before  # noqa: PTH208


def test_a_file_is_read_up_to_its_limit(tmp_path):
    path = tmp_path / "input"
    path.write_bytes(b"12345")
    assert read_bounded(path, 5) == b"12345"
    with pytest.raises(OSError, match="Has more than 4 bytes"):
        read_bounded(path, 4)
    os.truncate(path, 2**40)  # takes no room, and would take a terabyte of memory
    with pytest.raises(OSError, match="Has more than 5 bytes"):
        read_bounded(path, 5)


def test_a_file_appears_whole_or_not_at_all(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    with pytest.raises(TypeError), replacing(path) as file:
        file.writelines([b"new", None])
    with pytest.raises(FileNotFoundError), replacing_by_name(path):
        pass
    assert path.read_bytes() == b"old"
    with replacing_by_name(path) as name:
        assert name.parent.stat().st_mode & 0o777 == 0o700
        name.write_bytes(b"library's")
    assert path.read_bytes() == b"library's"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("write", [replacing, replacing_by_name])
def test_a_name_is_never_used_twice(tmp_path, write):
    """Who watches the folder learns nothing for the next time."""
    seen = set()
    for _ in range(5):
        with write(tmp_path / "file") as file:
            found = {path.name for path in tmp_path.iterdir()} - {"file"}
            assert len(found) == 1
            assert not found & seen
            seen |= found
            if isinstance(file, os.PathLike):
                os.close(os.open(file, os.O_CREAT | os.O_EXCL))
    assert len(seen) == 5
