"""What is said on a terminal when presses can be made."""

import threading
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from denseface.service.errors import AddressError, ClientTimeoutError
from denseface.service.settings import default_address
from denseface.service.tools import welcome
from tests.waiting import until


class Hub:
    """Answers as it is told: an error, or whether it is ready."""

    def __init__(self, *answers):
        self.answers = list(answers)

    def status(self, *, timeout):
        assert timeout < 5
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, Exception):
            raise answer
        return SimpleNamespace(ready=answer)


def welcomed(monkeypatch, hub):
    monkeypatch.setattr(welcome, "Client", lambda _: nullcontext(hub))
    return welcome.welcoming("ipc:///x", ["ready", "press"], look_s=0.001)


def test_it_is_said_once_when_all_is_ready(monkeypatch, capsys):
    hub = Hub(ClientTimeoutError("no answer"), False, True)
    with welcomed(monkeypatch, hub):
        until(lambda: not any(one.name == "welcome" for one in threading.enumerate()))
    assert capsys.readouterr() == ("", "ready\npress\n")


@pytest.mark.parametrize("answer", [False, ClientTimeoutError("none"), AddressError("wrong")])
def test_a_service_that_never_is_ready_is_not_welcomed(monkeypatch, capsys, answer):
    hub = Hub(answer)
    with welcomed(monkeypatch, hub):
        pass
    assert capsys.readouterr() == ("", "")
    assert not any(one.name == "welcome" for one in threading.enumerate())


def test_what_to_type_names_the_address_where_it_is_not_the_usual_one():
    usual = welcome.next_steps(default_address(), "")
    assert "  denseface press --save face.ply    take a picture now" in usual
    assert not any("page" in line for line in usual)
    other = welcome.next_steps("ipc:///run/my hub", "http://127.0.0.1:8080")
    assert "  denseface press --save face.ply --address 'ipc:///run/my hub'    take" in other[1]
    assert "the page for visitors: http://127.0.0.1:8080" in other
