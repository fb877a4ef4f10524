"""How often something may happen: so much at once, and so much a second in the long run."""

__all__ = ["TokenBucket"]


class TokenBucket:
    """Holds tokens, full at first.

    Parameters
    ----------
    burst : tokens that it holds at most
    per_s : tokens that come back, a second
    now : seconds, by the clock of all calls

    Attributes
    ----------
    tokens : what is left; whoever takes some may take more than there are
    """

    def __init__(self, burst: float, per_s: float, now: float) -> None:
        self.tokens = burst
        self._burst = burst
        self._per_s = per_s
        self._since = now

    def refill(self, now: float) -> None:
        """Put back what has come back."""
        self.tokens = min(self._burst, self.tokens + (now - self._since) * self._per_s)
        self._since = now

    def take(self, now: float) -> bool:
        """Take one; False where there is none."""
        self.refill(now)
        if self.tokens < 1:
            return False
        self.tokens -= 1
        return True
