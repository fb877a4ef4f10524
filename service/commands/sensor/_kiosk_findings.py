"""The doctor's look at the kiosk: whether it can run here, and whether it asks for a consent."""

import os
from collections.abc import Iterator, Mapping

from denseface.service.errors import SettingsError
from denseface.service.kiosk.answering import ask
from denseface.service.kiosk.installed import why_not
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.tools.doctor.findings import Finding, ok, problem, warning

_WHAT = "kiosk"
_ANSWER_S = 1.0
"""Longest wait for a kiosk of this machine, seconds."""
_NOT_ASKED = ("nobody is asked before a picture is taken",
              "unless all who come have agreed otherwise, start it without --kiosk-consent off "
              "and DENSEFACE_KIOSK_CONSENT=off")


def look_at_kiosk(environment: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    """Look at the kiosk's parts and settings, and at the one that runs here, if any."""
    if missing := why_not():
        # A service without one is whole.
        yield ok(_WHAT, f"cannot be served here: {missing.removeprefix('no kiosk: ')}")
        return
    try:
        settings = KioskSettings.of(environment)
    except SettingsError as error:
        yield problem(_WHAT, str(error), "correct the variable: `denseface up` refuses it")
        return
    answer = ask(settings, _ANSWER_S)
    if answer.another:
        yield warning(_WHAT, answer.ailment, "end what answers there, or give the kiosk another "
                      "address: denseface up --kiosk-address IP:PORT")
    elif answer.ailment:
        yield ok(_WHAT, f"can be served at {settings.url}; none answers there now")
    else:
        yield ok(_WHAT, f"serves at {settings.url}")
    if not (settings.consent if answer.asks_consent is None else answer.asks_consent):
        yield warning(_WHAT, *_NOT_ASKED)
