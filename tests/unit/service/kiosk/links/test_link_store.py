"""Links over the time, without a clock, a disk or a socket."""

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from denseface.service.kiosk.links.link_store import (
    BusyLinkError,
    GoneLinkError,
    LinkRecords,
    LinkStore,
    UnknownLinkError,
)

DAY_S = 86400.0


def store(**changed) -> LinkStore:
    return LinkStore(**{"uses": 2, "lifetime_s": 100.0, "now": 0.0} | changed)


def fetch(links: LinkStore, token: str, now: float, *, complete: bool = True) -> None:
    links.finish(links.begin(token, now).digest, now, complete=complete)


def test_a_token_has_at_least_128_bits_fits_into_a_url_and_is_not_kept():
    links = store()
    tokens = {links.make("capture-1", "en", 0.0)[0] for _ in range(50)}
    assert len(tokens) == 50
    assert all(len(token) * 6 >= 128 and token.isascii() for token in tokens)
    assert all(set(token) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_")
               for token in tokens)
    text = links.records().model_dump_json()
    assert not any(token in text for token in tokens)
    assert all(hashlib.sha256(token.encode()).hexdigest() in text for token in tokens)


def test_a_link_is_used_up_by_whole_downloads_alone():
    links = store()
    token, _ = links.make("capture-1", "de", 0.0)
    fetch(links, token, 1.0, complete=False)
    fetch(links, token, 2.0)
    assert links.find(token, 3.0).uses_left == 1
    fetch(links, token, 3.0, complete=False)
    fetch(links, token, 4.0)
    with pytest.raises(GoneLinkError) as gone:
        links.find(token, 5.0)
    assert gone.value.language == "de"
    assert "capture-1" not in links.records().model_dump_json()


def test_a_link_expires_and_a_token_of_nobody_is_unknown():
    links = store()
    token, _ = links.make("capture-1", "en", 0.0)
    links.find(token, 99.9)
    with pytest.raises(GoneLinkError):
        links.find(token, 100.0)
    with pytest.raises(UnknownLinkError):
        links.find(token + "x", 100.0)
    with pytest.raises(UnknownLinkError):
        links.find(token, 100.0 + 31 * DAY_S)  # a tombstone is not for ever


def test_no_more_downloads_are_under_way_than_uses_are_left():
    links = store()
    token, link = links.make("capture-1", "en", 0.0)
    links.begin(token, 0.0)
    links.begin(token, 0.0)
    with pytest.raises(BusyLinkError):
        links.begin(token, 0.0)
    links.finish(link.digest, 0.0, complete=False)
    links.begin(token, 0.0)
    links.finish(link.digest, 0.0, complete=True)
    links.finish(link.digest, 0.0, complete=True)
    with pytest.raises(GoneLinkError):
        links.begin(token, 0.0)


def test_a_withdrawn_capture_ends_all_its_links_and_its_downloads_and_leaves_no_name():
    links = store()
    first, link = links.make("capture-1", "en", 0.0)
    second, _ = links.make("capture-1", "en", 0.0)
    other, _ = links.make("capture-2", "en", 0.0)
    links.begin(first, 0.0)
    assert links.forget("capture-1", 1.0)
    assert not links.forget("capture-1", 1.0)
    assert not links.under_way(link.digest)
    for token in (first, second):
        with pytest.raises(GoneLinkError):
            links.find(token, 1.0)
    links.find(other, 1.0)
    assert not links.finish(link.digest, 1.0, complete=True)
    assert "capture-1" not in links.records().model_dump_json()


def test_a_download_that_began_in_time_may_end_later():
    links = store()
    token, link = links.make("capture-1", "en", 0.0)
    links.begin(token, 99.0)
    links.tidy(101.0)
    assert links.under_way(link.digest)


def test_links_survive_a_restart_and_a_clock_set_back_does_not_prolong_them():
    links = store(now=1000.0)
    token, _ = links.make("capture-1", "ar", 1000.0)
    gone, _ = links.make("capture-2", "en", 1000.0)
    fetch(links, token, 1000.0)
    links.forget("capture-2", 1000.0)
    kept = LinkRecords.model_validate_json(links.records().model_dump_json())
    again = store(kept=kept, now=10.0)
    assert again.find(token, 10.0).uses_left == 1
    with pytest.raises(GoneLinkError):
        again.find(gone, 10.0)
    with pytest.raises(GoneLinkError):
        again.find(token, 110.0)


def test_there_are_no_more_links_than_a_limit():
    links = store()
    first, _ = links.make("first", "en", 0.0)
    for n in range(1000):
        links.make(f"c{n}", "en", 0.0)
    assert len(links) == 1000
    with pytest.raises(GoneLinkError):
        links.find(first, 0.0)
    for n in range(2000):
        links.make(f"d{n}", "en", 0.0)
    assert len(links.records().gone) == 1000


@given(uses=st.integers(1, 6), ends=st.lists(st.booleans(), max_size=20))
def test_exactly_as_many_whole_downloads_as_there_are_uses(uses, ends):
    links = store(uses=uses)
    token, _ = links.make("capture-1", "en", 0.0)
    done = 0
    for complete in ends:
        try:
            fetch(links, token, 1.0, complete=complete)
        except GoneLinkError:
            assert done == uses
            continue
        done += complete
    assert done == min(uses, sum(ends))


class Downloads(RuleBasedStateMachine):
    """Any order of beginnings, ends, restarts and withdrawals over a time that passes."""

    def __init__(self):
        super().__init__()
        self.now = 0.0
        self.links = store(uses=3)
        self.token, self.link = self.links.make("capture-1", "en", self.now)
        self.begun = self.done = 0
        self.ended = False

    @rule()
    def begin(self):
        try:
            self.links.begin(self.token, self.now)
        except BusyLinkError:
            assert self.begun == 3 - self.done
        except GoneLinkError:
            assert self.ended or self.done == 3 or self.now >= 100
        else:
            assert not self.ended
            assert self.done < 3
            assert self.now < 100
            self.begun += 1

    @rule(complete=st.booleans())
    def finish(self, complete):
        if self.begun:
            self.begun -= 1
            counted = self.links.finish(self.link.digest, self.now, complete=complete)
            self.done += counted
            assert counted <= complete

    @rule(seconds=st.floats(0, 40))
    def wait(self, seconds):
        self.now += seconds

    @rule()
    def withdraw(self):
        self.links.forget("capture-1", self.now)
        self.ended = True

    @rule()
    def restart(self):
        self.begun = 0
        self.links = store(uses=3, kept=self.links.records(), now=self.now)

    @invariant()
    def never_more_than_its_uses(self):
        assert self.done <= 3
        assert self.begun + self.done <= 3 or self.ended or self.now >= 100


TestDownloads = Downloads.TestCase
