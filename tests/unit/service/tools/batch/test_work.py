"""What a worker does with a task: in this process, and in one that comes to an end."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from denseface.capture import open_source
from denseface.capture.npz import load_frame, save_frame
from denseface.service.errors import StoreError, UsageError
from denseface.service.tools.batch.parts import Part, Task
from denseface.service.tools.batch.plan import Plan
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.worker import making, work
from denseface.service.tools.batch.worker.words import WORDS, last_words
from denseface.service.tools.frames import FrameChoice
from tests.waiting import LIMIT_S

ROOT = Path(__file__).resolve().parents[5]
FRONTAL = ROOT / "fixtures" / "recorded_oni" / "frontal_700.oni"
PLAN = Plan(FrameChoice(10**7), report=True)


class NoWords:
    """In place of the last words: this process is not to be ended."""

    def about(self, *_):
        from contextlib import nullcontext

        return nullcontext()


@pytest.fixture(autouse=True)
def _quiet(monkeypatch):
    monkeypatch.setattr(work._held, "words", lambda _: NoWords())
    monkeypatch.setattr(work, "prepare", lambda: None)


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    path = tmp_path_factory.mktemp("frame") / "f.npz"
    with open_source(FRONTAL) as source:
        save_frame(next(iter(source)), path, quickly=True)
    return path


@pytest.fixture(scope="module")
def face(frame):
    from denseface.recon import reconstruct

    return reconstruct(load_frame(frame))


@pytest.fixture
def quick(monkeypatch, face):
    """Each face is the same, and taken from this list."""
    made = []
    monkeypatch.setattr(making, "reconstruct", lambda *_: made.append(1) or face)
    return made


def points_in(path):
    """Count the points of a .ply that is as long as it says."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    (count,) = (int(line.split()[2]) for line in head.splitlines() if b"element vertex" in line)
    assert len(body) % count == 0
    return count


def do(folder, *parts, plan=PLAN, frames=99, **more):
    task = Task(str(folder), plan.to_json(), parts, frames, 1e9, 99.0, **more)
    return work.run_task(task.to_plain())


def rows(answer, kind="rows"):
    return [Row.from_dict(row) for row in answer[kind]]


def test_a_recording_is_done_in_runs_and_not_twice(tmp_path, quick):
    part = Part(str(FRONTAL), "in/f.oni", many=True)
    answer = do(tmp_path, part, frames=2)
    assert [(row.frame, row.state, row.output) for row in rows(answer)] == [
        (0, "face", "faces/in/f.oni/00000.ply"), (1, "face", "faces/in/f.oni/00001.ply")]
    (left,) = [Part(*one) for one in answer["left"]]
    assert (left.first, left.stop, left.begun, answer["looked"]) == (2, 3, 0, 2)
    rest = do(tmp_path, left)
    assert ([row.frame for row in rows(rest)], rest["left"]) == ([2], [])
    assert len(quick) == 3
    for row in (*rows(answer), *rows(rest)):
        assert points_in(tmp_path / row.output) == row.dense
        assert (tmp_path / row.output).with_suffix(".json").exists()
        assert row.thumbnail
    again = do(tmp_path, part)
    assert rows(again, "kept") == [*rows(answer), *rows(rest)]
    assert (len(quick), again["rows"]) == (3, [])


@pytest.mark.parametrize("spoil", [
    lambda face, _: os.truncate(face, 1000), lambda face, _: face.unlink(),
    lambda face, _: face.with_suffix(".json").write_text("{"),
    lambda _, source: os.utime(source, (1, 1)),
    lambda face, _: (face.parents[2] / "records/in/f.json").write_text('{"row": 1}'),
    lambda face, _: (face.parents[2] / "records/in/f.json").write_bytes(b"\0" * 100),
], ids=["short", "gone", "report", "source", "no record", "zeros"])
def test_what_is_not_whole_any_more_is_done_again(tmp_path, frame, quick, spoil):
    source = shutil.copy(frame, tmp_path / "s.npz")
    part = Part(str(source), "in/f", many=False)
    do(tmp_path, part)
    spoil(tmp_path / "faces/in/f.ply", source)
    answer = do(tmp_path, part)
    assert (len(quick), len(answer["rows"]), answer["kept"]) == (2, 1, [])
    assert points_in(tmp_path / "faces/in/f.ply") == rows(answer)[0].dense


def test_of_a_recording_each_so_many_th_frame_is_taken(tmp_path, quick):
    answer = do(tmp_path, Part(str(FRONTAL), "f.oni", many=True),
                plan=Plan(FrameChoice(10**7), every=2))
    assert [row.frame for row in rows(answer)] == [0, 2]


def test_what_has_no_face_or_cannot_be_read_has_a_row_and_the_next_is_done(
        tmp_path, frame, quick, monkeypatch):
    from denseface.recon import NoFaceError

    cut = tmp_path / "cut.npz"
    cut.write_bytes(frame.read_bytes()[:5000])
    empty, own = shutil.copy(frame, tmp_path / "empty.npz"), making.reconstruct

    def some(frame, settings):
        if frame.origin.source == "broken":
            raise RuntimeError("never seen before")
        if frame.origin.source == "none":
            raise NoFaceError("nobody is there")
        return own(frame, settings)

    monkeypatch.setattr(making, "reconstruct", some)
    for name in ("broken", "none"):
        save_frame(load_frame(frame).with_source(name), tmp_path / f"{name}.npz", quickly=True)
    answer = do(tmp_path, *(Part(str(tmp_path / f"{name}.npz"), name, many=False)
                            for name in ("cut", "none", "gone", "broken", "empty")))
    assert [(row.state, row.error, row.frame) for row in rows(answer)] == [
        ("unreadable", "UnreadableSourceError", None), ("no_face", "NoFaceError", 0),
        ("unreadable", "UnreadableSourceError", None), ("failed", "RuntimeError", 0),
        ("face", "", 0)]
    assert "never seen before" in rows(answer)[3].why
    assert rows(answer)[1].thumbnail
    assert empty


def test_a_recording_that_is_cut_ends_there(tmp_path, quick, monkeypatch):
    from denseface.capture.errors import UnreadableSourceError
    from denseface.service.tools.frames import FrameReader

    read = FrameReader.read

    def damaged(self, number):
        if number >= 1:
            raise UnreadableSourceError("f.oni: damaged")
        return read(self, number)

    monkeypatch.setattr(FrameReader, "read", damaged)
    answer = do(tmp_path, Part(str(FRONTAL), "f.oni", many=True))
    assert [(row.frame, row.state) for row in rows(answer)] == [(0, "face"), (1, "unreadable")]
    assert rows(answer)[1].why == "f.oni: damaged; what follows in it is not read"


def failing(number, times):
    """Fail so often with an error of the system."""
    left = [times]

    def fail(*_):
        if left[0]:
            left[0] -= 1
            raise OSError(number, os.strerror(number), "disk")

    return fail


@pytest.mark.parametrize("many", [False, True])
def test_what_may_pass_is_tried_again_and_said_where_it_stays(
        tmp_path, frame, quick, monkeypatch, many):
    from denseface.service.tools.frames import FrameReader

    part = (Part(str(FRONTAL), "f.oni", many=True) if many else Part(str(frame), "f", many=False))
    count = FrameReader.count
    fail = failing(errno.ESTALE, 3)
    monkeypatch.setattr(FrameReader, "count", lambda self: fail() or count(self))
    for attempt in (1, 2):
        answer = do(tmp_path, part, attempt=attempt)
        assert answer["rows"] == []
        assert [Part(*one) for one in answer["again"]] == [part]
    (row,) = rows(do(tmp_path, part, attempt=3))
    assert (row.state, row.frame, row.attempts) == ("failed", None, 3)
    assert "Stale file handle" in row.why
    assert len(rows(do(tmp_path, part))) == (3 if many else 1)


@pytest.mark.parametrize(("number", "passing"), [(errno.ENOSPC, False), (errno.EIO, True)])
def test_where_nothing_can_be_written_the_task_says_so(
        tmp_path, frame, quick, monkeypatch, number, passing):
    import denseface.files

    fail = failing(number, 1)
    write = os.write
    monkeypatch.setattr(denseface.files.os, "write", lambda *given: fail() or write(*given))
    part = Part(str(frame), "f", many=False)
    answer = do(tmp_path, part, part)
    assert (answer["rows"], answer["passing"]) == ([], passing)
    assert answer["full"] == (number == errno.ENOSPC)
    assert answer["stop"] == f"{tmp_path / 'faces/f.ply'}: {os.strerror(number)}"
    assert list((tmp_path / "faces").iterdir()) == []


def test_a_worker_of_another_version_or_without_the_folder_says_so(tmp_path, frame, monkeypatch):
    task = Task(str(tmp_path), PLAN.to_json().replace('"version": "', '"version": "9'),
                [Part(str(frame), "f", many=False)], 1, 1.0, 9.0)
    with pytest.raises(UsageError, match="a worker has denseface "):
        work.run_task(task.to_plain())
    monkeypatch.undo()
    monkeypatch.setattr(work, "prepare", lambda: None)
    with pytest.raises(StoreError, match=r"none: a worker on .* cannot write there: No such file"):
        work.run_task(Task(str(tmp_path / "none"), PLAN.to_json(), [], 1, 1.0, 9.0).to_plain())


SAYING = """
import ctypes, os, sys
from pathlib import Path
from denseface.service.tools.batch.worker.words import LastWords
with LastWords(Path(sys.argv[1])).about("s.oni", 3, "in/s.oni/00003", float(sys.argv[2])):
    {how}
"""


@pytest.mark.parametrize(("how", "error", "why"), [
    ("ctypes.string_at(0)", "WorkerCrashed", "its worker crashed: Segmentation fault"),
    ("ctypes.PyDLL(None).sleep(60)", "TimeLimit", "its worker took longer than 0.2 s for it"),
    ("os.kill(os.getpid(), 9)", "WorkerKilled", "its worker was killed while it made it"),
    ("pass", None, None),
], ids=["crash", "hang", "kill", "end"])
def test_the_last_words_of_a_process_say_what_it_had_and_how_it_ended(tmp_path, how, error, why):
    limit_s = 0.2 if error == "TimeLimit" else LIMIT_S
    ended = subprocess.run([sys.executable, "-c", SAYING.format(how=how), tmp_path, str(limit_s)],
                           check=False, cwd=ROOT, capture_output=True)
    said = list(last_words(tmp_path))
    assert (ended.returncode == 0) == (error is None)
    if error is None:
        assert said == []
        return
    (one,) = said
    assert (one.source, one.frame, one.name, one.error) == (
        "s.oni", 3, "in/s.oni/00003", error)
    assert one.why.startswith(why)
    assert oct((tmp_path / WORDS).stat().st_mode)[-3:] == "700"
