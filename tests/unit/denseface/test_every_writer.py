"""Whatever is written for a user is whole or not there, whichever call to the system fails."""

import errno
import os
from pathlib import Path

import pytest

from denseface.capture.npz import save_frame
from denseface.service.commands.sensor import calibrate
from denseface.service.export import FORMATS, FaceFiles, save_face
from denseface.service.kiosk.links.link_file import LinkFile, LinkRecords
from denseface.service.kiosk.operator.token import OperatorToken
from denseface.service.security._keys import write_key_file
from tests.unit.service.faces import small_face, small_frame

FACE, FRAME = small_face(), small_frame()
CALLS = "open", "write", "fsync", "fstat", "close", "replace", "mkdir"
"""All by which a file is made."""
ERRORS = errno.ENOSPC, errno.EIO, errno.EDQUOT


class Faults:
    """Lets the call of one number fail; those that are about a folder are counted."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = os.fspath(folder)
        self.failing, self.error = -1, errno.EIO
        self.calls: list[str] = []
        self._ours: set[int] = set()
        for name in CALLS:
            monkeypatch.setattr(os, name, self._counted(name, getattr(os, name)))

    def _counted(self, name, real):
        def call(target, *args, **more):
            ours = target in self._ours if isinstance(target, int) else (
                os.fspath(target).startswith(self.folder))
            if not ours or (name == "mkdir" and Path(target).is_dir()):
                return real(target, *args, **more)
            self.calls.append(name)
            fails = len(self.calls) - 1 == self.failing
            if name == "close":  # it is closed, whatever it says
                self._ours.discard(target)
                found = real(target)
            if fails and self.error:
                raise OSError(self.error, os.strerror(self.error))
            if name == "write" and fails:  # the disk takes a part
                args = (args[0][:len(args[0]) // 2],)
            if name != "close":
                found = real(target, *args, **more)
            if name == "open":
                self._ours.add(found)
            return found

        return call


WRITERS = {
    **{f"face{ending}": lambda path: save_face(FACE, path) for ending in FORMATS},
    "report.json": lambda path: FaceFiles(report=path).write(FACE),
    "picture.png": lambda path: FaceFiles(rendering=path).write(FACE),
    "new/folder/face.stl": lambda path: FaceFiles(path, mode=0o640).write(FACE),
    "frame.npz": lambda path: save_frame(FRAME, path),
    "a.calibration.json": lambda path: calibrate._write(path, b"{}"),
    "mine.secret": lambda path: write_key_file(path, LinkRecords()),
    "operator-token.sha256": lambda path: OperatorToken(path.parent).renew(),
    "links.json": lambda path: LinkFile(path).write(LinkRecords()),
}
"""What writes a file of that name."""


@pytest.fixture
def faults(tmp_path, monkeypatch):
    for drawn in ("render.render", "turning.animation.to_webp", "turning.animation.to_mp4"):
        monkeypatch.setattr(f"denseface.service.export.{drawn}", lambda _: b"a picture" * 99)
    tmp_path.chmod(0o700)
    return Faults(tmp_path, monkeypatch)


def _remove_empty(folder):
    for path in sorted(folder.rglob("*"), reverse=True):
        path.rmdir()


def files(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("old", [b"old", None])
@pytest.mark.parametrize("name", WRITERS)
def test_whichever_call_fails_a_file_is_whole_or_as_it_was(tmp_path, faults, name, old):
    path, write = tmp_path / name, WRITERS[name]
    write(path)
    calls = list(faults.calls)
    if old is not None:
        faults.calls.clear()
        write(path)
        calls = list(faults.calls)
    assert {"open", "write", "fsync", "close", "replace"} <= set(calls)
    for failing in range(len(calls)):
        path.unlink(missing_ok=True)
        if old is not None:
            path.write_bytes(old)
        else:
            _remove_empty(tmp_path)
        error = ERRORS[failing % len(ERRORS)]
        faults.calls.clear()
        faults.failing, faults.error = failing, error
        try:
            with pytest.raises(Exception, match=os.strerror(error)) as raised:
                write(path)
        finally:
            faults.failing = -1
        if "replace" not in faults.calls[:-1]:
            assert files(tmp_path) == ({} if old is None else {path: old}), (calls, failing)
        else:  # what failed is that its name is on the disk for certain
            assert list(files(tmp_path)) == [path]
            assert path.stat().st_size > len(b"old")
        assert str(path) in str(raised.value)


@pytest.mark.parametrize("name", WRITERS)
def test_a_disk_that_takes_a_part_is_given_the_rest(tmp_path, faults, name):
    path, write = tmp_path / name, WRITERS[name]
    write(path)
    sizes = {path.stat().st_size}
    faults.calls.clear()
    write(path)
    faults.failing, faults.error = faults.calls.index("write"), 0
    before = len(faults.calls)
    faults.calls.clear()
    write(path)
    assert len(faults.calls) == before + 1
    sizes.add(path.stat().st_size)
    assert len(sizes) == 1 or name == "face.npz"
