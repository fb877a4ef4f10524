"""What every answer says to the browser: nothing from outside, no frames, no guesses, no store."""

from collections.abc import MutableMapping
from typing import Any

from denseface.service.kiosk.web.asgi import App, Receive, Scope, Send

__all__ = ["CONTENT_SECURITY_POLICY", "SecurityHeaders"]

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'")
"""Scripts, styles and all else come from this server, none stands in the page itself."""
_FEATURES = ("accelerometer", "camera", "display-capture", "geolocation",
             "gyroscope", "hid", "magnetometer", "microphone", "midi", "payment",
             "publickey-credentials-get", "serial", "usb", "xr-spatial-tracking")
"""Of browsers; the page needs none: the camera is the service's."""
_HEADERS = {
    "content-security-policy": CONTENT_SECURITY_POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": ", ".join(f"{name}=()" for name in _FEATURES),
    "cache-control": "no-store",
    "x-robots-tag": "noindex",
}
"""An answer that says one of them itself is not contradicted."""
_ENCODED = [(name.encode(), value.encode()) for name, value in _HEADERS.items()]


class SecurityHeaders:
    """Adds these headers to all answers of an application, errors too."""

    def __init__(self, app: App) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer."""
        async def with_headers(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                given = list(message.get("headers", ()))
                names = {name.lower() for name, _ in given}
                message["headers"] = [*given, *(one for one in _ENCODED if one[0] not in names)]
            await send(message)

        await self._app(scope, receive, with_headers)
