"""Files that do not pass through the page cache are the same files."""

import errno
import fcntl
import os

import pytest

from denseface.service.runtime import _direct_io
from denseface.service.storage._record_file import read_parts, write_parts

PARTS = [b"header", os.urandom(2**20 + 17), b"", memoryview(os.urandom(3 * 2**20 + 1))]


def written(monkeypatch):
    """Note how much of each file was written past the cache."""
    sizes, real = [], os.write

    def write(descriptor, data):
        count = real(descriptor, data)
        if fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_DIRECT:
            sizes.append(count)
        return count

    monkeypatch.setattr(_direct_io.os, "write", write)
    return sizes


def test_it_holds_what_any_other_holds(tmp_path, monkeypatch):
    sizes = written(monkeypatch)
    with monkeypatch.context() as patch:
        patch.setattr("denseface.service.runtime.files.write_direct", lambda *_: False)
        plain = write_parts(tmp_path / "plain", PARTS)
    assert sizes == []
    assert write_parts(tmp_path / "direct", PARTS) == plain
    assert (tmp_path / "direct").read_bytes() == (tmp_path / "plain").read_bytes()
    assert read_parts(tmp_path / "direct", plain)[0] == [bytes(part) for part in PARTS]
    # What a longer file left in the buffer is not in a shorter one.
    write_parts(tmp_path / "short", PARTS[:2])
    assert read_parts(tmp_path / "short")[0] == [bytes(part) for part in PARTS[:2]]
    if not sizes:
        pytest.skip("the file system of the temporary folder has no direct writing")


def test_a_short_write_goes_on(tmp_path, monkeypatch):
    real = os.write
    monkeypatch.setattr(
        _direct_io.os, "write", lambda descriptor, data: real(descriptor, data[:2**20]))
    checksum = write_parts(tmp_path / "x", PARTS)
    assert read_parts(tmp_path / "x", checksum)[0] == [bytes(part) for part in PARTS]


@pytest.mark.parametrize("at", [0, 1])
def test_where_it_cannot_be_had_the_cache_is_used(tmp_path, monkeypatch, at):
    calls, real = [], os.write

    def refuses(descriptor, data):
        calls.append(descriptor)
        if len(calls) > at:
            raise OSError(errno.EINVAL, "Invalid argument")
        return real(descriptor, data[:2**20])

    with monkeypatch.context() as patch:
        patch.setattr(_direct_io.os, "write", refuses)
        checksum = write_parts(tmp_path / "x", PARTS)
    assert calls
    assert read_parts(tmp_path / "x", checksum)[0] == [bytes(part) for part in PARTS]


def test_a_full_disk_is_told(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(_direct_io.os, "write", full)
    with pytest.raises(OSError, match="no room on the disk"):
        write_parts(tmp_path / "x", PARTS)
    assert list(tmp_path.iterdir()) == []
