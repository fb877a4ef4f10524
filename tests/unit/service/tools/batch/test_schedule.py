"""What is sent when, and what becomes of what is lost: with an engine that computes nothing."""

import json
from itertools import count

import pytest

from denseface.service.errors import DiskFullError, StoreError
from denseface.service.tools.batch.engines.engine import Done
from denseface.service.tools.batch.losses import Losses
from denseface.service.tools.batch.parts import Part, Task
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.schedule import Schedule
from denseface.service.tools.batch.worker.words import WORDS


class FakeEngine:
    """Does tasks in their order, in no time: a frame takes what `frame_s` says."""

    def __init__(self, folder, totals=(), width=2, frame_s=0.1):
        self.width, self._folder, self._totals = width, folder, dict(totals)
        self._frame_s, self._numbers, self._waiting = frame_s, count(), {}
        self.poison, self.words, self.refusals = {}, True, []
        self.sent, self.most = [], 0

    def submit(self, task, worker=""):
        json.dumps(task)  # plain values alone
        handle = next(self._numbers)
        self._waiting[handle] = task, worker
        self.most = max(self.most, len(self._waiting))
        return handle

    def completed(self):
        while self._waiting:
            handle = next(iter(self._waiting))
            plain, worker = self._waiting.pop(handle)
            self.sent.append((Task.of_plain(plain), worker))
            yield Done(handle, self._do(Task.of_plain(plain)), "w1")

    def _do(self, task):
        answer = {"rows": [], "kept": [], "left": [], "again": [], "stop": "", "passing": False,
                  "full": False, "looked": 0, "seconds": 0.0}
        if self.refusals:
            return answer | self.refusals.pop(0)
        for at, part in enumerate(task.parts):
            frame = part.first
            stop = self._totals.get(part.source, 1)
            if part.stop is not None:
                stop = min(stop, part.stop)
            while frame < stop:
                if answer["looked"] >= task.frames:
                    answer["left"] = [list(part._replace(first=frame, stop=stop)),
                                      *map(list, task.parts[at + 1:])]
                    return answer
                if self._dies(part.source, frame):
                    return None
                answer["looked"] += 1
                answer["seconds"] += self._frame_s
                answer["rows"].append(Row(
                    source=part.source, frame=frame, state="face", output=part.named(frame),
                    attempts=task.attempt).as_dict())
                frame += 1
        return answer

    def _dies(self, source, frame):
        left = self.poison.get((source, frame), 0)
        if left and self.words:
            words = self._folder / WORDS
            words.mkdir(exist_ok=True)
            said = json.dumps([source, frame, "x", 9.0]) + "\nTimeout (0:00:09)!\n"
            (words / f"w-{next(self._numbers)}.txt").write_text(said)
        self.poison[source, frame] = max(0, left - 1)
        return left


def run(engine, folder, sources, **more):
    rows = []
    schedule = Schedule(engine, Task(str(folder), "{}", [], 0, 0.0, 9.0), iter(sources),
                        Losses(folder), lambda new, _: rows.extend(new), **more)
    schedule.run()
    assert schedule.expected(schedule._begun) == len(rows)
    return rows


def recording(name):
    return Part(f"/in/{name}.oni", f"{name}.oni", many=True)


def files(number):
    return (Part(f"/in/{at}.npz", str(at), many=False) for at in range(number))


def keys(rows):
    return sorted((row.source, row.frame) for row in rows)


def test_each_frame_of_each_source_is_done_once(tmp_path):
    totals = {"/in/a.oni": 40, "/in/b.oni": 1, "/in/c.oni": 7}
    engine = FakeEngine(tmp_path, totals)
    rows = run(engine, tmp_path, [*files(11), *map(recording, "abc"), *files(0)])
    assert keys(rows) == sorted([(f"/in/{at}.npz", 0) for at in range(11)] + [
        (source, frame) for source, total in totals.items() for frame in range(total)])


def test_tasks_grow_to_a_third_of_a_second_and_few_are_under_way(tmp_path):
    engine = FakeEngine(tmp_path, width=3, frame_s=0.05)
    run(engine, tmp_path, files(200))
    sizes = [len(task.parts) for task, _ in engine.sent]
    assert sizes[:6] == [2] * 6  # before any came back
    assert set(sizes[6:-1]) == {7}
    assert engine.most == 6


def test_a_frame_that_takes_long_is_a_task(tmp_path):
    engine = FakeEngine(tmp_path, frame_s=2.0)
    run(engine, tmp_path, files(20))
    assert {len(task.parts) for task, _ in engine.sent[8:]} == {1}


def test_many_sources_are_never_in_memory(tmp_path):
    engine = FakeEngine(tmp_path, width=2, frame_s=1e-5)
    done, ahead = 0, []

    def gather(new, kept):
        nonlocal done
        done += len(new)
        ahead.append(schedule._begun - done)

    schedule = Schedule(engine, Task(str(tmp_path), "{}", [], 0, 0.0, 9.0), files(5_000),
                        Losses(tmp_path), gather)
    schedule.run()
    assert done == 5_000
    assert max(ahead) <= 4 * 256, "four tasks of the most frames"


def test_a_recording_is_read_on_where_it_is_open_and_shared_out_at_the_end(tmp_path):
    engine = FakeEngine(tmp_path, {"/in/a.oni": 400}, width=2)
    rows = run(engine, tmp_path, [recording("a")])
    assert keys(rows) == [("/in/a.oni", frame) for frame in range(400)]
    runs = {}
    for task, worker in engine.sent:
        (part,) = task.parts
        runs.setdefault(part.begun, []).append((part.first, worker))
    assert len(runs) == 4
    for firsts in runs.values():
        assert [first for first, _ in firsts] == sorted(first for first, _ in firsts)
        assert all(worker == "w1" for _, worker in firsts[1:])


def test_two_recordings_are_not_shared_out_while_there_are_others(tmp_path):
    engine = FakeEngine(tmp_path, {f"/in/{at}.oni": 50 for at in range(12)}, width=2)
    run(engine, tmp_path, [recording(str(at)) for at in range(12)])
    shared = {task.parts[0].source for task, _ in engine.sent if task.parts[0].begun}
    assert len(shared) <= 3


@pytest.mark.parametrize("words", [True, False])
def test_a_poison_frame_is_named_and_the_rest_of_its_task_goes_on(tmp_path, words):
    engine = FakeEngine(tmp_path, {"/in/a.oni": 30})
    engine.poison, engine.words = {("/in/a.oni", 17): 99, ("/in/3.npz", 0): 99}, words
    rows = run(engine, tmp_path, [*files(9), recording("a")])
    failed = {(row.source, row.frame): row for row in rows if row.state == "failed"}
    assert len(keys(rows)) == len(set(keys(rows))) == 39
    assert failed.keys() == {("/in/a.oni", 17), ("/in/3.npz", 0)}
    for row in failed.values():
        assert row.error == ("TimeLimit" if words else "WorkerLost")
        assert "longer than 9 s" in row.why if words else "lost" in row.why
    deaths = [99 - left for left in engine.poison.values() if left]
    assert max(deaths) <= (3 if words else 40)
    assert not words or not list((tmp_path / WORDS).iterdir())


def test_a_worker_that_was_killed_once_costs_its_task_alone(tmp_path):
    engine = FakeEngine(tmp_path, {"/in/a.oni": 30})
    engine.poison = {("/in/a.oni", 8): 1}
    rows = run(engine, tmp_path, [recording("a")])
    assert {row.state for row in rows} == {"face"}
    assert keys(rows) == [("/in/a.oni", frame) for frame in range(30)]
    assert 1 <= sum(row.attempts > 1 for row in rows) <= 4


def test_a_source_that_kills_whoever_opens_it_ends(tmp_path):
    engine = FakeEngine(tmp_path, {"/in/a.oni": 10**6})
    engine.poison = dict.fromkeys((("/in/a.oni", frame) for frame in range(100)), 99)
    rows = run(engine, tmp_path, [recording("a"), *files(3)])
    failed = {row.frame: row.why for row in rows if row.state == "failed"}
    assert "of its frames ended their workers, the rest is not tried" in failed.pop(None)
    assert 3 <= len(failed) <= 8
    assert [row.state for row in rows].count("face") == 3


def test_a_full_disk_ends_it_and_one_that_may_recover_is_tried_again(tmp_path):
    full = {"stop": "/out/x.ply: No space left on device", "full": True}
    engine = FakeEngine(tmp_path)
    engine.refusals = [full]
    with pytest.raises(DiskFullError, match=r"^/out/x.ply: No space left on device$"):
        run(engine, tmp_path, files(3))
    passing = {"stop": "/out/x.ply: Stale file handle", "passing": True}
    engine = FakeEngine(tmp_path)
    engine.refusals = [passing, passing]
    assert len(run(engine, tmp_path, files(3))) == 3
    engine = FakeEngine(tmp_path)
    engine.refusals = [passing] * 9
    with pytest.raises(StoreError, match="Stale file handle"):
        run(engine, tmp_path, files(3))
