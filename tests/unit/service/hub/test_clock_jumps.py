"""The wall clock is set while captures are under way: nothing is lost, shown twice or removed."""

import pytest

from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore
from tests.unit.service.clocks import FakeClock
from tests.unit.service.hub.bench import SETTINGS, Bench

_DAY_S = 86400.0


@pytest.mark.parametrize("jump_s", [-3650 * _DAY_S, -60.0, 60.0, 3650 * _DAY_S])
@pytest.mark.parametrize("restart", [False, True])
def test_a_jump_at_each_step_of_a_capture_s_life(tmp_path, jump_s, restart):
    clock = FakeClock()
    settings = SETTINGS.model_copy(update={"retention": _DAY_S})
    now, published = 100.0, []
    steps = ("sensor", "press", "frame", "worker", "result", "wait")
    for jump_before in steps:
        data = tmp_path / jump_before
        store = FolderStore(data, clock)
        bench = Bench(Hub(store, settings, Settings()), store, now)
        for step in steps:
            if step == jump_before:
                clock.set_wall(jump_s)
                if restart and step in ("worker", "wait"):  # after it was accepted, after its face
                    published = bench.published
                    store.__exit__()
                    store = FolderStore(data, clock)
                    bench = Bench(Hub(store, settings, Settings()), store, now, published)
            if step == "wait":
                bench.wait(10.0)
            else:
                getattr(bench, step)()
            clock.pass_time(1.0)
            now = bench.now = bench.now + 1.0
        assert [(one.kind, one.sequence) for one in bench.published] == [("face_done", 1)]
        assert bench.store.find("a").state is CaptureState.DONE
        assert bench.store.outcome("a").message.capture_id == "a"
        store.__exit__()
