"""Sessions and tries over the time."""

import pytest

from denseface.service.kiosk.operator.sessions import (
    IDLE_S,
    LONGEST_S,
    Sessions,
    TooManyTriesError,
)


def test_a_session_is_known_by_its_secret_alone_until_it_ends():
    sessions = Sessions(0.0)
    one, two = (sessions.begin("a", "token", 0.0) for _ in range(2))
    assert one != two
    assert len(one) >= 40
    assert sessions.knows(one, "token", 1.0)
    for wrong in ("", "x", one[:-1], one.lower(), "é\udcff"):
        assert not sessions.knows(wrong, "token", 1.0)
    sessions.end(one)
    sessions.end(one)
    assert not sessions.knows(one, "token", 1.0)
    assert sessions.knows(two, "token", 1.0)
    assert not any(secret in str(vars(sessions)) for secret in (one, two))


def test_a_session_ends_when_nothing_is_asked_and_after_a_day_at_work():
    sessions = Sessions(0.0)
    session = sessions.begin("a", "token", 0.0)
    assert not Sessions(0.0).knows(session, "token", 0.0)
    now = 0.0
    while now + IDLE_S / 2 < LONGEST_S:
        now += IDLE_S / 2
        assert sessions.knows(session, "token", now)
    assert not sessions.knows(session, "token", LONGEST_S)
    session = sessions.begin("a", "token", 0.0)
    assert not sessions.knows(session, "token", IDLE_S)


def test_another_token_ends_the_sessions_of_the_one_before():
    sessions = Sessions(0.0)
    session = sessions.begin("a", "token", 0.0)
    assert not sessions.knows(session, "another", 1.0)
    assert not sessions.knows(session, "token", 1.0)


def test_each_wrong_token_of_an_address_doubles_its_wait():
    sessions = Sessions(0.0)
    waits = []
    now = 0.0
    for _ in range(14):
        sessions.wrong("a", now)
        try:
            sessions.may_try("a", now)
        except TooManyTriesError as error:
            waits.append(round(error.wait_s))
            now += error.wait_s
    assert waits[:9] == [1, 2, 4, 8, 16, 32, 64, 128, 256]
    assert set(waits[9:]) == {300}
    sessions.may_try("b", now)
    sessions.may_try("a", now)
    sessions.begin("a", "token", now)
    sessions.wrong("a", now)
    sessions.may_try("a", now)  # as before the first


def test_many_addresses_together_have_to_wait_too():
    sessions = Sessions(0.0)
    for n in range(30):
        sessions.may_try(f"address {n}", 0.0)
        sessions.wrong(f"address {n}", 0.0)
    with pytest.raises(TooManyTriesError):
        sessions.may_try("another", 0.0)
    sessions.may_try("another", 10.0)


def test_there_are_few_sessions():
    sessions = Sessions(0.0)
    first = sessions.begin("a", "token", 0.0)
    for _ in range(16):
        sessions.begin("a", "token", 0.0)
    assert not sessions.knows(first, "token", 0.0)
