"""The page that a link leads to, and those that say why there is none: HTML without a script."""

import base64
import hashlib
from datetime import datetime
from html import escape
from pathlib import Path

from denseface.service.kiosk.links.face_files import FORMATS
from denseface.service.kiosk.texts import Texts

__all__ = ["CONTENT_SECURITY_POLICY", "message_page", "page"]

_STYLE = Path(__file__).with_name("page.css").read_text()
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; style-src 'sha256-"
    + base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
    + "'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
"""The style stands in the page, for nothing but pages and files is served; nothing else may."""


def page(texts: Texts, token: str, uses_left: int, until: datetime) -> str:
    """Write the page of a link that is good.

    Parameters
    ----------
    token : of the link
    uses_left : downloads
    until : when it expires, local time
    """
    files = "".join(
        f'<li><a href="{escape(token)}/face.{kind}" download="face.{kind}">'
        f"<b>{escape(texts[f'links.{kind}.name'])}</b>"
        f"<span>{escape(texts[f'links.{kind}.about'])}</span>"
        f"<i>{escape(texts['links.fetch'])}</i></a></li>" for kind in FORMATS)
    return _document(texts, "links.title", (
        f"<p>{escape(texts['links.intro'])}</p><dl>"
        f"<div><dt>{escape(texts['links.until'])}</dt>"
        f'<dd><time datetime="{until:%Y-%m-%dT%H:%M%z}">{_shown(until)}</time></dd></div>'
        f"<div><dt>{escape(texts['links.uses'])}</dt><dd>{uses_left}</dd></div></dl>"
        f"<ul>{files}</ul><small>{escape(texts['links.private'])}</small>"))


def message_page(texts: Texts, what: str) -> str:
    """Write the page that says why there is nothing: `gone`, `unknown`, `busy`."""
    return _document(texts, f"links.{what}.title", f"<p>{escape(texts[f'links.{what}.text'])}</p>")


def _shown(until: datetime) -> str:
    """Write a time of today as a time alone, of another day with its date (ISO 8601)."""
    today = datetime.now(until.tzinfo).date() == until.date()
    return f"{until:%H:%M}" if today else f"{until:%Y-%m-%d} {until:%H:%M}"


def _document(texts: Texts, title: str, body: str) -> str:
    heading = escape(texts[title])
    return (f'<!DOCTYPE html><html lang="{escape(texts.language)}" dir="{texts.direction}"><head>'
            '<meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f'<link rel="icon" href="data:,"><title>{heading}</title><style>{_STYLE}</style></head>'
            f"<body><main><h1>{heading}</h1>{body}</main></body></html>")
