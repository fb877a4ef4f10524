"""The doctor's look at the kiosk: whether it can run here, and whether it asks for a consent."""

import json
import os
from collections.abc import Iterator, Mapping
from urllib.request import ProxyHandler, build_opener

from denseface.service.errors import SettingsError
from denseface.service.kiosk.installed import why_not
from denseface.service.kiosk.settings import KioskSettings, is_loopback
from denseface.service.tools.doctor.findings import Finding, ok, problem, warning

_WHAT = "kiosk"
_ANSWER_S = 1.0
"""Longest wait for a kiosk of this machine, seconds."""
_MAX_ANSWER = 4096
"""Bytes of its answer."""
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
    url = settings.url
    asks = (_ask(f"{url}/healthz") if is_loopback(settings.address) and settings.address[1]
            else None)
    if asks is None:
        yield ok(_WHAT, f"can be served at {url}; none answers there now")
    else:
        yield ok(_WHAT, f"serves at {url}")
    if not (settings.consent if asks is None else asks):
        yield warning(_WHAT, *_NOT_ASKED)


def _ask(url: str) -> bool | None:
    """Say whether the kiosk that runs asks for a consent; None where none answers."""
    try:
        with build_opener(ProxyHandler({})).open(url, timeout=_ANSWER_S) as answer:
            said = json.loads(answer.read(_MAX_ANSWER))
    except (OSError, ValueError):  # nobody, something else, or a certificate of its own
        return None
    asks = said.get("consent") if isinstance(said, dict) else None
    return asks if isinstance(asks, bool) else None
