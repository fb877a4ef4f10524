"""Capability links over the time: who holds a token may fetch the files of one capture.

A token is kept as its SHA-256 alone: who reads the file of links cannot fetch a face with it.
"""

import hashlib
import secrets
from collections.abc import Callable
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from denseface.service.errors import ServiceError
from denseface.service.kiosk.language import Language
from denseface.service.protocol.message_base import CaptureId, Digest

__all__ = [
    "BusyLinkError", "GoneLinkError", "GoneRecord", "LinkRecord", "LinkRecords", "LinkStore",
    "UnknownLinkError",
]

_TOKEN_BYTES = 24
"""Random bytes of a token: 192 bits, 32 characters."""
_MAX_LINKS = 1000
"""Links that are kept; a further one ends the oldest."""
_MAX_GONE = 1000
"""Ended links that are remembered, so that they answer "gone" rather than "unknown"."""
_GONE_S = 30 * 86400.0
"""Time for which an ended link is remembered, seconds: a month of coming back to a bookmark."""

_Time = Annotated[float, Field(ge=0, allow_inf_nan=False)]
"""Seconds since 1970, for it is compared after a restart too."""


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    digest: Digest
    """SHA-256 of the token."""
    language: Language
    """Of the visitor."""


class LinkRecord(_Record):
    """A link that is good."""

    capture_id: CaptureId
    uses_left: Annotated[int, Field(ge=1)]
    expires_at: _Time


class GoneRecord(_Record):
    """A link that was used up, expired or withdrawn: of what, is not known any more."""

    since: _Time


class LinkRecords(BaseModel):
    """All that is kept of links."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    version: Literal[1] = 1
    links: tuple[LinkRecord, ...] = ()
    gone: tuple[GoneRecord, ...] = ()


class UnknownLinkError(ServiceError, LookupError):
    """No link has this token."""


class GoneLinkError(ServiceError, LookupError):
    """There was a link with this token.

    Attributes
    ----------
    language : of the visitor it was made for
    """

    def __init__(self, language: str) -> None:
        super().__init__("the link is gone")
        self.language = language


class BusyLinkError(ServiceError, RuntimeError):
    """All uses that are left are under way; one that is broken off is free again.

    Attributes
    ----------
    language : of the visitor it was made for
    """

    def __init__(self, language: str) -> None:
        super().__init__("all uses left of the link are under way")
        self.language = language


class LinkStore:
    """The links of one kiosk; `now` is in seconds since 1970 everywhere.

    Parameters
    ----------
    uses : downloads that each link is good for
    lifetime_s : seconds after which each expires
    kept : what `records` gave before a restart
    """

    def __init__(
        self, *, uses: int, lifetime_s: float, kept: LinkRecords | None = None, now: float,
        new_token: Callable[[], str] = lambda: secrets.token_urlsafe(_TOKEN_BYTES),
    ) -> None:
        self._uses = uses
        self._lifetime_s = lifetime_s
        self._new_token = new_token
        self._links: dict[str, LinkRecord] = {}
        self._gone: dict[str, GoneRecord] = {}
        self._under_way: dict[str, int] = {}
        """Digest -> downloads begun and not ended."""
        for link in kept.links if kept else ():
            # A clock that was set back must not prolong a link.
            self._links[link.digest] = link.model_copy(
                update={"expires_at": min(link.expires_at, now + lifetime_s)})
        for gone in kept.gone if kept else ():
            self._gone[gone.digest] = gone
        self.tidy(now)

    def __len__(self) -> int:
        """Give the number of links that are good."""
        return len(self._links)

    def records(self) -> LinkRecords:
        """Give all that is to survive a restart."""
        return LinkRecords(links=tuple(self._links.values()), gone=tuple(self._gone.values()))

    def make(self, capture_id: str, language: str, now: float) -> tuple[str, LinkRecord]:
        """Make a link to a capture's files; give its token, which is not kept, and its record."""
        self.tidy(now)
        while len(self._links) >= _MAX_LINKS:
            self._end(next(iter(self._links)), now)
        token = self._new_token()
        link = LinkRecord(
            digest=_digest(token), capture_id=capture_id, language=language, uses_left=self._uses,
            expires_at=now + self._lifetime_s)
        self._links[link.digest] = link
        return token, link

    def find(self, token: str, now: float) -> LinkRecord:
        """Give the link of a token.

        Raises
        ------
        GoneLinkError
            It was used up, has expired or was withdrawn.
        UnknownLinkError
            There is none, or it is gone for more than a month.
        """
        self.tidy(now)
        digest = _digest(token)
        if link := self._links.get(digest):
            return link
        if gone := self._gone.get(digest):
            raise GoneLinkError(gone.language)
        raise UnknownLinkError("no such link")

    def under_way(self, digest: str) -> bool:
        """Say whether a download that was begun may go on: its link was not withdrawn."""
        return digest in self._under_way

    def begin(self, token: str, now: float) -> LinkRecord:
        """Begin a download, which takes one use until it ends; give its link.

        Raises as `find`; BusyLinkError where no use is free.
        """
        link = self.find(token, now)
        if self._under_way.get(link.digest, 0) >= link.uses_left:
            raise BusyLinkError(link.language)
        self._under_way[link.digest] = self._under_way.get(link.digest, 0) + 1
        return link

    def finish(self, digest: str, now: float, *, complete: bool) -> bool:
        """End a download that was begun; say whether the links have changed.

        A download that was broken off gives its use back.
        """
        left = self._under_way.pop(digest, 0) - 1
        if left > 0:
            self._under_way[digest] = left
        link = self._links.get(digest)
        if link is None or not complete:
            return False
        if link.uses_left == 1:
            self._end(digest, now)
        else:
            self._links[digest] = link.model_copy(update={"uses_left": link.uses_left - 1})
        return True

    def forget(self, capture_id: str, now: float) -> bool:
        """End all links to a capture; say whether there were any."""
        digests = [link.digest for link in self._links.values() if link.capture_id == capture_id]
        for digest in digests:
            self._end(digest, now)
            self._under_way.pop(digest, None)
        return bool(digests)

    def _end(self, digest: str, now: float) -> None:
        link = self._links.pop(digest)
        self._gone[digest] = GoneRecord(digest=digest, language=link.language, since=now)
        while len(self._gone) > _MAX_GONE:
            del self._gone[next(iter(self._gone))]

    def tidy(self, now: float) -> bool:
        """End what has expired, and forget what is gone for long; say whether there was any."""
        expired = [one.digest for one in self._links.values() if one.expires_at <= now]
        for digest in expired:
            self._end(digest, now)
        forgotten = [one.digest for one in self._gone.values() if one.since <= now - _GONE_S]
        for digest in forgotten:
            del self._gone[digest]
        return bool(expired or forgotten)


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode(errors="surrogateescape")).hexdigest()
