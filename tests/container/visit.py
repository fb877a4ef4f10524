"""A visitor of the kiosk, who says what its page says (`service/kiosk/page_messages.py`)."""

import json
import time
from typing import Any

from websockets.sync.client import connect

from tests.container.box import LIMIT_S

__all__ = ["visit"]


def visit(url: str) -> str:
    """Make a visit to a kiosk's page, from its first screen to the face and back."""
    seen: list[str] = []
    points = face = 0
    with connect(f"ws{url.removeprefix('http')}/ws", origin=url, max_size=2**26) as page:
        def say(kind: str, **more: Any) -> None:
            page.send(json.dumps({"kind": kind, "visit": number} | more))

        number, deadline = 0, time.monotonic() + LIMIT_S
        while time.monotonic() < deadline:
            came = page.recv(timeout=LIMIT_S)
            if isinstance(came, bytes):
                if came[0] == 1:
                    say("next")
                else:
                    face = len(came)
                continue
            said = json.loads(came)
            if said["kind"] != "screen":
                continue
            number, screen = said["visit"], said["name"]
            if seen[-1:] == [screen]:
                continue
            seen.append(screen)
            if screen == "attract" and len(seen) == 1:
                say("begin")
            elif screen == "consent":
                say("consent", agreed=True, language="en")
            elif screen == "position":
                say("next")
            elif screen == "result":
                points = said["result"]["dense_points"]
                say("drawn", capture_id=said["result"]["capture_id"])
                say("delete")
            elif screen == "thanks":
                assert face > 10_000
                assert points > 50_000
                assert said["thanks"]["deleted"] is True
                return f"{' > '.join(seen)}: {points:,} points, {face:,} bytes, withdrawn"
            elif screen == "failed":
                break
    raise AssertionError(f"the visit ended with {seen}")
