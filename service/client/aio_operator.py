"""The operator for asyncio: the calls of `service.client.operator`, awaited."""

from collections.abc import AsyncIterator
from datetime import datetime
from functools import cached_property

from denseface.service.client._operator_exchanges import OperatorExchanges
from denseface.service.client.aio import AsyncClient
from denseface.service.protocol.message_base import CaptureSummary, DeadLetter


class AsyncOperator(AsyncClient):
    """The calls of `Operator` for asyncio."""

    @cached_property
    def _asks(self) -> OperatorExchanges:
        return OperatorExchanges(self._exchanges)

    async def captures(
        self, last: int = 20, *, timeout: float = 5.0
    ) -> tuple[CaptureSummary, ...]:
        """List the captures that were accepted last; see `Operator.captures`."""
        return await self._run(self._asks.captures(last, timeout))

    async def dead(self, *, timeout: float = 5.0) -> AsyncIterator[DeadLetter]:
        """List the captures that were given up; see `Operator.dead`."""
        after = 0
        while letters := await self._run(self._asks.dead(after, timeout)):
            for one in letters:
                yield one
            after = letters[-1].sequence

    async def retry(self, capture_id: str, *, timeout: float = 5.0) -> None:
        """Try a capture that was given up again; see `Operator.retry`."""
        await self._run(self._asks.retry(capture_id, timeout))

    async def drop(self, capture_id: str, *, timeout: float = 5.0) -> None:
        """Remove a capture that was given up; see `Operator.drop`."""
        await self._run(self._asks.drop(capture_id, timeout))

    async def purge(
        self, *, capture_id: str | None = None, before: datetime | None = None,
        everything: bool = False, timeout: float = 30.0,
    ) -> int:
        """Remove captures; see `Operator.purge`."""
        return await self._run(self._asks.purge(capture_id, before, everything, timeout))

    async def restart_sensor(self, name: str, *, timeout: float = 5.0) -> None:
        """Have a capture process begin anew; see `Operator.restart_sensor`."""
        await self._run(self._asks.restart_sensor(name, timeout))
