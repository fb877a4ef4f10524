"""A daemon's connection to the hub, as its service manager hears of it."""

from denseface.service.runtime.wake_pipe import WakePipe
from denseface.service.runtime.watching.service_manager import ServiceManager
from denseface.service.runtime.watching.supervisor_link import SupervisorLink
from denseface.service.settings import ServiceSettings
from denseface.service.transport.hub_connection import HubConnection


class Said(ServiceManager):
    """Keeps what it says, and has a limit of a second."""

    def __init__(self):
        super().__init__({"WATCHDOG_USEC": "1000000"}, lambda: 0.0)
        self.said = []

    def _say(self, state):
        self.said.append(state)


class Stop(WakePipe):
    """A signal that came before all else, or after the first round."""

    def __init__(self, *, rounds):
        super().__init__()
        self.rounds = rounds

    def __bool__(self):
        self.rounds -= 1
        return self.rounds < 0


def test_a_process_that_is_told_to_stop_says_so_and_one_that_is_silent_by_its_settings_may_be(
        tmp_path):
    manager = Said()
    settings = ServiceSettings(address=f"ipc://{tmp_path}/hub", heartbeat_s=0.7, liveness=3)
    with HubConnection(settings, "test", SupervisorLink(None, manager)) as connection, \
            Stop(rounds=1) as stop, WakePipe() as wake:
        for _ in connection.packets(stop, wake):
            wake.wake()
    assert manager.said == ["WATCHDOG_USEC=2100000", "WATCHDOG=1", "STOPPING=1"]
