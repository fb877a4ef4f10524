"""Recording without a driver: frame files, played as they are or as if they were live."""

import errno
import os
import signal
import threading
from dataclasses import replace

import numpy as np
import pytest

from denseface.capture import open_source
from denseface.capture.frame import FrameOrigin
from denseface.capture.npz import save_frame
from denseface.capture.oni.recorded import Recorded
from denseface.capture.oni.writer import OniWriter
from denseface.service.errors import StoreError, UsageError
from denseface.service.storage import FolderStore
from denseface.service.tools import _recording, record
from tests.unit import frames
from tests.waiting import LIMIT_S, until


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Whose reader takes long to end ends its process, which is this one."""
    monkeypatch.setattr(_recording, "_CLOSING_S", LIMIT_S)


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "shown"
    folder.mkdir()
    for number in range(4):
        one = frames.frame(np.full((120, 160), 700 + number, np.uint16),
                           np.zeros((120, 160, 3), np.uint8))
        save_frame(replace(
            one, depth_timestamp_us=number * 20_000, color_timestamp_us=number * 20_000),
            folder / f"{number}.npz")
    return folder


def test_what_is_done_is_shown(folder, tmp_path, monkeypatch, capsys):
    shown = []
    monkeypatch.setattr(record.Progress, "show", lambda _, text: shown.append(text()))
    out = tmp_path / "take.oni"
    assert record.run(str(folder), None, out, frames=3) == 0
    assert capsys.readouterr() == (f"{out}: 3 frames; as long as asked for\n", "")
    done = [text for text in shown if text != "waiting: the source"]  # for the first frame
    assert done[0] == "1 frames, 0.0 s, 0 lost"


@pytest.mark.parametrize(("limits", "held"), [
    ({"seconds": 0.04}, 2), ({"seconds": 0.045}, 3), ({"seconds": 60.0}, 4), ({"frames": 9}, 4),
    ({"frames": 2, "seconds": 60.0}, 2), ({"frames": 4, "seconds": 0.015}, 1)])
def test_a_recording_is_as_long_as_the_stamps_of_its_source_say(folder, tmp_path, limits, held):
    out = tmp_path / "take.oni"
    assert record.run(str(folder), None, out, **limits) == 0
    assert Recorded(out).pairs == held


@pytest.mark.parametrize("name", ["take.oni", "take"])
@pytest.mark.parametrize("mode", [0o600, 0o640])
def test_pictures_of_people_are_for_those_who_may_see_them(folder, tmp_path, name, mode):
    before = os.umask(0)
    try:
        record.run(str(folder), None, tmp_path / name, frames=1, mode=mode)
    finally:
        os.umask(before)
    out = tmp_path / name
    for path in out.iterdir() if out.is_dir() else [out]:
        assert path.stat().st_mode & 0o777 == mode
    assert not out.is_dir() or out.stat().st_mode & 0o777 == 0o700


def test_doubts_are_printed_once(folder, tmp_path, monkeypatch, capsys):
    note = "the colour is from yesterday"
    real = _recording.open_source

    def doubtful(*arguments, **more):
        source = real(*arguments, **more)
        source.prepared = lambda one: replace(one, origin=FrameOrigin(notes=(note,)))
        return source

    monkeypatch.setattr(_recording, "open_source", doubtful)
    assert record.run(str(folder), None, tmp_path / "take.oni") == 0
    assert capsys.readouterr().err == f"warning: {note}\n"


def test_frames_that_come_faster_than_they_can_be_written_are_counted(
        folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(_recording, "_QUEUED", 2)
    readers = []
    real = _recording.FrameReader

    def reader(*arguments):
        readers.append(real(*arguments))
        return readers[0]

    def slow(writer, frame):
        until(lambda: readers[0].lost > 3 * writer.frames)
        return add(writer, frame)

    add = OniWriter.add
    monkeypatch.setattr(record, "FrameReader", reader)
    monkeypatch.setattr(OniWriter, "add", slow)
    out = tmp_path / "take.oni"
    assert record.run(f"{folder}?rate=real", None, out, frames=3) == 0
    assert Recorded(out).pairs == 3
    assert "3 frames, " in (said := capsys.readouterr().out)
    assert "were lost; as long as asked for" in said


@pytest.mark.usefixtures("heard_sighup")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_before_the_first_frame(folder, tmp_path, monkeypatch, capsys, number):
    (folder / "0.npz").rename(folder / "late")
    asked = threading.Event()

    def never(*_, **__):
        asked.set()
        threading.Event().wait(LIMIT_S)

    monkeypatch.setattr(_recording, "open_sensor", never)
    monkeypatch.setattr(_recording, "_CLOSING_S", 0.1)
    ended = []
    monkeypatch.setattr(record, "exit_now", ended.append)
    threading.Thread(target=lambda: asked.wait(LIMIT_S) and os.kill(os.getpid(), number)).start()
    out = tmp_path / "take.oni"
    status = record.run(str(folder), None, out)
    assert status == (130 if number == signal.SIGINT else 0)
    assert ended == [status], "a driver that hangs does not keep the process"
    by = "Ctrl-C" if number == signal.SIGINT else number.name
    assert capsys.readouterr().out == f"{out}: nothing was recorded; stopped by {by}\n"
    assert not out.exists()


def test_where_a_recording_cannot_be(folder, tmp_path):
    with pytest.raises(UsageError, match=r"expected NAME\.oni or a folder"):
        record.run(str(folder), None, tmp_path / "take.mp4")
    (tmp_path / "take.oni").write_text("precious")
    with pytest.raises(UsageError, match="there is a recording already"):
        record.run(str(folder), None, tmp_path / "take.oni")
    with pytest.raises(UsageError, match="there is a recording already"):
        record.run(str(folder), None, folder)
    FolderStore(tmp_path / "data").close()
    for name in ("data", "data/take.oni"):
        with pytest.raises(UsageError, match="is a hub's data folder"):
            record.run(str(folder), None, tmp_path / name)
    for name in ("take.oni/take.oni", "take.oni/take"):
        with pytest.raises(StoreError, match=r"take\.oni/take.*: .*take\.oni is no folder$"):
            record.run(str(folder), None, tmp_path / name)
    assert (tmp_path / "take.oni").read_text() == "precious"


@pytest.mark.parametrize("name", ["take.oni", "take"])
def test_missing_folders_are_made_for_who_may_see_the_recording(folder, tmp_path, name, capsys):
    out = tmp_path / "new" / "folder" / name
    assert record.run(f"{folder}?end=stop", None, out, mode=0o640) == 0
    assert capsys.readouterr().out.startswith(f"{out}: ")
    assert [path.stat().st_mode & 0o777 for path in out.parents[:2]] == [0o750, 0o750]


@pytest.mark.parametrize("name", ["take.oni", "take"])
def test_a_recording_that_cannot_be_completed_is_told(folder, tmp_path, monkeypatch, capsys, name):
    def fails(_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", fails)
    out = tmp_path / name
    assert record.run(f"{folder}?end=stop", None, out) == 1
    assert capsys.readouterr().out.endswith(
        "; the source is at its end; it could not be completed: Input/output error\n")
    with open_source(out) as source:
        assert len(list(source)) == source.frame_count > 0
