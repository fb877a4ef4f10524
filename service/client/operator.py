"""What an operator asks of the hub: captures, dead letters, removal. Needs the role `operator`."""

from collections.abc import Iterator
from datetime import datetime
from functools import cached_property

from denseface.service.client._operator_exchanges import OperatorExchanges
from denseface.service.client.blocking import Client
from denseface.service.protocol.message_base import CaptureSummary, DeadLetter


class Operator(Client):
    """A `Client` that may also list, remove and restart."""

    @cached_property
    def _asks(self) -> OperatorExchanges:
        return OperatorExchanges(self._exchanges)

    def captures(self, last: int = 20, *, timeout: float = 5.0) -> tuple[CaptureSummary, ...]:
        """List the captures that were accepted last, the newest first; at most 50."""
        return self._run(self._asks.captures(last, timeout))

    def dead(self, *, timeout: float = 5.0) -> Iterator[DeadLetter]:
        """List the captures that were given up and are kept, by sequence number."""
        after = 0
        while letters := self._run(self._asks.dead(after, timeout)):
            yield from letters
            after = letters[-1].sequence

    def retry(self, capture_id: str, *, timeout: float = 5.0) -> None:
        """Try a capture that was given up again, with all its attempts.

        Raises
        ------
        UnknownCaptureError
            The hub has no such capture.
        RequestFailedError
            It is no dead letter, or its frame is damaged.
        """
        self._run(self._asks.retry(capture_id, timeout))

    def drop(self, capture_id: str, *, timeout: float = 5.0) -> None:
        """Remove a capture that was given up; raises as `retry`."""
        self._run(self._asks.drop(capture_id, timeout))

    def purge(
        self, *, capture_id: str | None = None, before: datetime | None = None,
        everything: bool = False, timeout: float = 30.0,
    ) -> int:
        """Remove captures, whatever became of them, and give their number.

        Parameters
        ----------
        capture_id, before, everything : exactly one: this id; what was accepted before this time,
            with a zone; everything, what is in quarantine included
        timeout : longest time in which nothing is removed, seconds

        Raises
        ------
        RequestFailedError
            The disk refuses, or another program has the hub's database open.
        """
        return self._run(self._asks.purge(capture_id, before, everything, timeout))

    def restart_sensor(self, name: str, *, timeout: float = 5.0) -> None:
        """Have the capture process of a sensor begin anew, with its driver.

        Its presses are refused. `denseface up` starts the process again; one that runs alone opens
        its source again.

        Raises
        ------
        RequestFailedError
            No sensor of this name is connected.
        """
        self._run(self._asks.restart_sensor(name, timeout))
