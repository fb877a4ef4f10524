"""Clocks that go as a test says."""

from datetime import UTC, datetime, timedelta


class SteppingClock:
    """Moves on by a step, seconds, whenever it is read."""

    def __init__(self, step: float = 1.0) -> None:
        self.now, self.step = 0.0, step

    def __call__(self) -> float:
        self.now += self.step
        return self.now


class FakeClock:
    """A machine's two clocks."""

    def __init__(self) -> None:
        self._wall = datetime(2026, 1, 31, 12, tzinfo=UTC)
        self._boots = 1
        self._at = 100.0

    def wall(self) -> datetime:
        return self._wall

    def boot(self) -> tuple[str, float]:
        return f"boot {self._boots}", self._at

    def pass_time(self, seconds: float) -> None:
        self._wall += timedelta(seconds=seconds)
        self._at += seconds

    def set_wall(self, seconds: float) -> None:
        """Move the wall clock alone."""
        self._wall += timedelta(seconds=seconds)

    def restart(self, off_s: float) -> None:
        """Switch the machine off for a while."""
        self._wall += timedelta(seconds=off_s)
        self._boots += 1
        self._at = 10.0
