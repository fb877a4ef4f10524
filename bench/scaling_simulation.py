"""A schedule of very many tasks on very many workers, simulated: who waits for whom.

One client hands out tasks of several frames, a few for each worker; one scheduler passes each on
and its answer back; both do one thing after the other. Workers are of different speed, and die.
"""

import heapq
import math
import random
from collections import deque
from dataclasses import dataclass, replace
from itertools import count

__all__ = ["Costs", "Fleet", "Outcome", "simulate", "sized"]


@dataclass(frozen=True)
class Costs:
    """Processor time of one task outside of its frames, seconds; as measured."""

    scheduler: float
    client: float
    """Of a task, without its rows."""
    client_row: float
    """Of a row: checked, counted and written into the summary."""
    worker: float
    """Of the worker's process, while it does nothing for the next task."""
    way: float
    """From one process to the next, without anybody's processor, seconds."""


@dataclass(frozen=True)
class Fleet:
    """Workers, and what they are given."""

    workers: int
    frame_s: float
    """Mean time of a frame on a worker of usual speed, seconds."""
    spread: float = 0.5
    """Standard deviation of a frame's time, of its mean."""
    frames_a_task: int = 16
    under_way: int = 2
    """Tasks for each worker that are sent at a time."""
    slow_share: float = 0.0
    """Of the workers are so many times slower:"""
    slow_factor: float = 3.0
    dies_each_s: float = math.inf
    """Mean time until a worker dies, seconds."""
    back_after_s: float = 60.0
    """Until another takes its place, seconds."""


@dataclass(frozen=True)
class Outcome:
    """How it went."""

    seconds: float
    efficiency: float
    """Time of the frames that were done, over that of all workers."""
    steady: float
    """The same while there is work for all: between the first and the last tenth of the tasks."""
    scheduler: float
    """Share of its time that it worked."""
    client: float
    lost: int
    """Tasks that were begun anew."""


@dataclass
class _Server:
    """Does one thing after the other, on one of some cores that it shares with others, if any."""

    cores_s: list[float]
    """When each is free, a heap; none where everybody has one."""
    free_s: float = 0.0
    worked_s: float = 0.0

    def serve(self, now_s: float, takes_s: float) -> float:
        """Give when it is done."""
        begins_s = max(now_s, self.free_s)
        if self.cores_s:
            begins_s = max(begins_s, heapq.heappop(self.cores_s))
            heapq.heappush(self.cores_s, begins_s + takes_s)
        self.free_s = begins_s + takes_s
        self.worked_s += takes_s
        return self.free_s


def simulate(
    fleet: Fleet, costs: Costs, tasks: int, seed: int = 0, times_s: list[float] | None = None,
    cores: int = 0,
) -> Outcome:
    """Do tasks until all are done.

    Parameters
    ----------
    times_s : of each task, seconds, instead of ones that are drawn
    cores : that scheduler, client and workers share for all but the frames; 0 where each has one
    """
    choose = random.Random(seed)  # noqa: S311 - a simulation
    cores_s = [0.0] * cores
    scheduler, client = _Server(cores_s), _Server(cores_s)
    own = [_Server(cores_s) for _ in range(fleet.workers)]
    slow = [fleet.slow_factor if number < round(fleet.slow_share * fleet.workers) else 1.0
            for number in range(fleet.workers)]
    choose.shuffle(slow)
    queues: list[deque[float]] = [deque() for _ in slow]
    """Times of the tasks that wait at each worker."""
    busy, load, free_s = [False] * len(slow), [0] * len(slow), [0.0] * len(slow)
    hungry: list[int] = []
    """Workers that came back and have nothing to do."""
    idle = list(range(fleet.workers)) * fleet.under_way
    events: list[tuple[float, int, str, int, float]] = []
    order = count()
    begun = done = lost = 0
    work_s, last_s, marks = 0.0, 0.0, []

    def later(at_s: float, what: str, worker: int, task_s: float) -> None:
        heapq.heappush(events, (at_s, next(order), what, worker, task_s))

    def draw() -> float:
        if times_s is not None:
            return times_s[begun - 1]
        mean = fleet.frames_a_task * fleet.frame_s
        return max(0.1 * mean, choose.gauss(
            mean, fleet.spread * fleet.frame_s * math.sqrt(fleet.frames_a_task)))

    def send(now_s: float, worker: int, task_s: float) -> None:
        load[worker] += 1
        ready_s = client.serve(now_s, costs.client / 2) + costs.way
        later(ready_s, "scheduler", worker, task_s)

    def start(now_s: float, worker: int) -> None:
        if busy[worker] or not queues[worker]:
            return
        busy[worker] = True
        task_s = queues[worker].popleft()
        takes_s = task_s * slow[worker]
        dies_s = choose.expovariate(1 / fleet.dies_each_s) if fleet.dies_each_s < math.inf else (
            math.inf)
        begins_s = max(now_s, free_s[worker])
        if dies_s < takes_s:
            later(begins_s + dies_s, "died", worker, task_s)
        else:
            later(begins_s + takes_s, "ended", worker, task_s)

    for worker in idle:
        if begun < tasks:
            begun += 1
            send(0.0, worker, draw())
    while done < tasks:
        now_s, _, what, worker, task_s = heapq.heappop(events)
        if what == "scheduler":
            later(scheduler.serve(now_s, costs.scheduler / 2) + costs.way, "worker", worker, task_s)
        elif what == "worker":
            queues[worker].append(task_s)
            start(now_s, worker)
        elif what == "died":
            busy[worker] = False
            free_s[worker] = now_s + fleet.back_after_s
            again = [task_s, *queues[worker]]
            lost += len(again)
            queues[worker].clear()
            load[worker] -= len(again)
            later(free_s[worker], "back", worker, 0.0)
            for one in again:  # to whom has the least to do, as a scheduler would
                other = min(choose.sample(range(len(slow)), min(4, len(slow))),
                            key=lambda at: (free_s[at] > now_s, load[at]))
                send(now_s, other, one)
        elif what == "ended":
            later(own[worker].serve(now_s, costs.worker), "computed", worker, task_s)
        elif what == "back":
            hungry.extend([worker] * fleet.under_way)
            start(now_s, worker)
        elif what == "computed":
            busy[worker] = False
            load[worker] -= 1
            work_s += task_s
            start(now_s, worker)
            later(scheduler.serve(now_s + costs.way, costs.scheduler / 2) + costs.way,
                  "answered", worker, task_s)
        else:
            rows = costs.client_row * fleet.frames_a_task
            last_s = client.serve(now_s, costs.client / 2 + rows)
            done += 1
            marks.append((now_s, task_s))
            if begun < tasks:
                begun += 1
                # Who has more than others since one died gives back what it was given.
                spare = hungry and load[worker] >= fleet.under_way
                send(last_s, hungry.pop() if spare else worker, draw())
    tenth = max(1, tasks // 10)
    middle = marks[tenth:-tenth] or marks
    span = middle[-1][0] - middle[0][0]
    return Outcome(
        last_s, work_s / (fleet.workers * last_s),
        sum(one for _, one in middle[1:]) / (fleet.workers * span) if span > 0 else 0.0,
        scheduler.worked_s / last_s, client.worked_s / last_s, lost)


def sized(fleet: Fleet, task_s: float) -> Fleet:
    """Give the same fleet with tasks of about a time."""
    return replace(fleet, frames_a_task=max(1, round(task_s / fleet.frame_s)))
