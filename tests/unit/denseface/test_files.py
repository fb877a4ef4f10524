"""Files from outside, and files that are whole or not there."""

import errno
import os
import socket
from pathlib import Path

import pytest

from denseface.files import check_place, open_regular, read_bounded, write_whole


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
    write_whole(path, [b"o", memoryview(b"ld"), b""])
    with pytest.raises(TypeError):
        write_whole(path, [b"new", None])
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_name_is_never_used_twice(tmp_path, monkeypatch):
    """Who watches the folder learns nothing for the next time."""
    seen, replace = [], Path.replace
    monkeypatch.setattr(Path, "replace", lambda one, to: [seen.append(one), replace(one, to)])
    for _ in range(5):
        write_whole(tmp_path / "file", [b"x"])
    assert len(set(seen)) == 5
    assert {path.parent for path in seen} == {tmp_path}


@pytest.mark.parametrize(("mode", "expected"), [(None, 0o755), (0o600, 0o700), (0o640, 0o750)])
def test_missing_folders_are_made_for_who_may_read_the_file(tmp_path, mode, expected):
    before = os.umask(0o022)
    try:
        write_whole(tmp_path / "a" / "b" / "file", [b"x"], mode=mode)
    finally:
        os.umask(before)
    assert {(tmp_path / name).stat().st_mode & 0o777 for name in ("a", "a/b")} == {expected}


def test_a_place_is_tried_and_nothing_is_left_there(tmp_path):
    check_place(tmp_path / "a" / "b" / "file", 2**16)
    (tmp_path / "file").write_bytes(b"old")
    check_place(tmp_path / "file", 2**16)
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    (tmp_path / "folder").mkdir()
    for name, why in (("file/new", "is no folder"), ("folder", "directory"),
                      ("link/new", "no folder")):
        with pytest.raises(OSError, match=why) as raised:
            check_place(tmp_path / name)
        assert raised.value.filename == str(tmp_path / name)
    assert {path.name for path in tmp_path.iterdir()} == {"file", "folder", "link"}
    assert (tmp_path / "file").read_bytes() == b"old"


def test_a_place_without_room_or_right_is_known_before(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OSError, match=r"No space left on device: .*file'"):
        check_place(tmp_path / "file", 1)
    assert list(tmp_path.iterdir()) == []
    # As on file systems that cannot reserve: then it is seen when the file is written.
    monkeypatch.setattr(os, "posix_fallocate", lambda *_: no_such_call())
    check_place(tmp_path / "file", 1)
    with pytest.raises(OSError, match="/proc/file"):
        check_place(Path("/proc/file"))


def no_such_call():
    raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))
