"""One round: so many presses in a storm, then the checker."""

import json
import random
import re
from collections import Counter
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path

import zmq

from denseface.service.protocol.topics import Topic
from denseface.service.transport.addresses import publications_of
from tests.chaos.cluster import Nursery
from tests.chaos.history import Answer, History, violations
from tests.chaos.proxy import Proxy
from tests.chaos.scene import Scene
from tests.chaos.source import CHEAP
from tests.chaos.storm import Storm, random_actions
from tests.chaos.thief import Thief
from tests.waiting import PATIENCE

__all__ = ["Outcome", "is_supervised", "play"]

_SUPERVISED_EVERY = 5
"""One round of so many runs `denseface up`, and not its parts alone."""
_PRESSERS, _AHEAD = 4, 2
_THEFT = 0.5
"""Chance of a round with a thief."""
_PRESSES_S, _SETTLE_S = 1800.0 * PATIENCE, 180.0 * PATIENCE
"""Longest time for all presses in the storm, and for the rest after it; seconds."""


@dataclass
class Outcome:
    """What came of one round, or of several."""

    faults: Counter[str] = field(default_factory=Counter)
    answers: Counter[str] = field(default_factory=Counter)
    ends: Counter[str] = field(default_factory=Counter)
    redelivered: int = 0
    restarts: int = 0
    latencies_s: list[float] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)

    def add(self, other: "Outcome") -> None:
        """Take another round in."""
        self.faults += other.faults
        self.answers += other.answers
        self.ends += other.ends
        self.redelivered += other.redelivered
        self.restarts += other.restarts
        self.latencies_s += other.latencies_s
        self.violations += other.violations


def is_supervised(seed: int) -> bool:
    """Say whether the round of this seed runs `denseface up`."""
    return seed % _SUPERVISED_EVERY == 0


def play(nursery: Nursery, folder: Path, frame: Path, presses: int, seed: int) -> Outcome:
    """Play a round; its folder keeps data, logs and history.

    Parameters
    ----------
    presses : as many are to be accepted
    seed : of the faults; when they come depends on the machine too
    """
    source = random.Random(seed)
    supervised = is_supervised(seed)
    actions = random_actions(source)
    outcome = Outcome()
    with ExitStack() as stack:
        proxies: list[Proxy] = []

        def between(hub: str) -> str:
            proxy = Proxy(hub, seed, lose=source.choice((0.0, 0.01)),
                          double=source.choice((0.0, 0.05)), delay=source.choice((0.0, 0.05)))
            proxies.append(stack.enter_context(proxy))
            return proxy.address

        thief = stack.enter_context(Thief(folder, seed)) if source.random() < _THEFT else None
        scene = stack.enter_context(Scene(
            nursery, folder, frame, thief=thief, workers=source.choice((1, 2)), recon=CHEAP,
            actions=actions,
            environment={"DENSEFACE_ATTEMPTS": str(source.choice((2, 3, 5))),
                         "DENSEFACE_HANG_TIMEOUT_S": f"{3 * PATIENCE:g}"},
            daemons_at=between, supervised=supervised))
        context = stack.enter_context(zmq.Context())
        deaf = stack.enter_context(context.socket(zmq.SUB))
        for option, value in ((zmq.RCVHWM, 1), (zmq.LINGER, 0)):
            deaf.set(option, value)
        deaf.subscribe(Topic.FACES)
        deaf.connect(publications_of(scene.cluster.address))

        storm = Storm(scene, source, actions, spoil=not supervised and seed % 4 == 3)
        for number in range(_PRESSERS):
            scene.press(f"s{seed}-p{number}", -(-presses // _PRESSERS), _AHEAD)
        storm.start()
        try:
            scene.pressed(_PRESSES_S)
            storm.calm()
            scene.settle(_SETTLE_S)
        except TimeoutError as error:
            outcome.violations.append(str(error))
        if storm.is_alive():
            storm.calm()
        if thief:
            outcome.violations += thief.stolen
            storm.counts["an id taken by another key"] += thief.tried
        history = scene.finish()
        outcome.violations += violations(history)
        outcome.violations += scene.cluster.tracebacks()
        outcome.faults = storm.counts + Counter({
            f"message {fate}": count for proxy in proxies for fate, count in proxy.counts.items()
            if fate != "passed"})
    _measure(outcome, scene, history)
    (folder / "history.json").write_text(json.dumps(
        {"seed": seed, "presses": presses, "violations": outcome.violations,
         "history": asdict(history) | {"damaged": sorted(history.damaged)}}, indent=1))
    return outcome


def _measure(outcome: Outcome, scene: Scene, history: History) -> None:
    outcome.answers = Counter(str(answer) for answer in history.pressed.values())
    outcome.ends = Counter(one.state for one in history.kept)
    outcome.restarts = scene.cluster.restarts()
    log = scene.cluster.hub.log.read_text(errors="replace")
    outcome.redelivered = sum(int(number) > 1 for number in re.findall(r"attempt=(\d+)", log))
    outcome.latencies_s = [
        scene.follower.at[capture_id] - presser.began[capture_id]
        for presser in scene.pressers for capture_id, answer in presser.answers.items()
        if answer is Answer.ACCEPTED and capture_id in scene.follower.at]
