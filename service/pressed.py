"""Who pressed what: a presser may get its own faces, not those of others."""

__all__ = ["Pressed"]

_MOST = 10_000


class Pressed:
    """The keys that pressed, for the newest captures; the first to press an id has it."""

    def __init__(self) -> None:
        self._keys: dict[str, str] = {}

    def note(self, capture_id: str, key: str, *, anew: bool) -> None:
        """Note a press with the fingerprint of its key.

        Parameters
        ----------
        anew : the hub knows no capture of this id, any more: it is not the one pressed before
        """
        if anew:
            self._keys.pop(capture_id, None)
        self._keys.setdefault(capture_id, key)
        if len(self._keys) > _MOST:
            del self._keys[next(iter(self._keys))]

    def by(self, capture_id: str, key: str) -> bool:
        """Say whether this key pressed it."""
        return self._keys.get(capture_id) == key
