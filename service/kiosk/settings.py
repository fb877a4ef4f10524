"""Settings of the kiosk: where the page is, what a visit is like, what may be fetched."""

import ssl
from collections.abc import Mapping
from ipaddress import ip_address
from pathlib import Path
from typing import Annotated, Any, Self
from urllib.parse import urlsplit

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from denseface.folders import user_folder
from denseface.service.errors import SettingsError, first_error
from denseface.service.kiosk.certificates import tls_context
from denseface.service.kiosk.language import Language
from denseface.service.runtime.parsing import parse_address
from denseface.service.settings import given_settings
from denseface.validation import PEER_NAME

__all__ = ["Address", "KioskSettings", "is_loopback"]

_PREFIX = "DENSEFACE_KIOSK_"
_FLAG = "--kiosk-"
Address = tuple[str, int]
"""IP address and port; port 0 is any free one."""
_PAIRS = (("certificate", "key"), ("lan_certificate", "lan_key"))
"""A certificate's setting and its key's."""


def is_loopback(address: Address) -> bool:
    """Say whether only this machine can connect."""
    return ip_address(address[0]).is_loopback


def _address(given: object) -> object:
    return parse_address(given) if isinstance(given, str) else given


def _split(given: object) -> object:
    return tuple(filter(None, given.split(","))) if isinstance(given, str) else given


def _switch(given: object) -> object:
    if isinstance(given, bool):
        return given
    if given not in ("on", "off"):
        raise ValueError("expected on or off")
    return given == "on"


def _origin(given: str) -> str:
    """Check an origin as browsers write it: scheme, host, and a port that is not the default."""
    try:
        parts = urlsplit(given)
        host, port = parts.hostname or "", parts.port
    except ValueError:
        host, port = "", None
    host = f"[{host}]" if ":" in host else host
    if port is not None and port != {"http": 80, "https": 443}.get(parts.scheme):
        host = f"{host}:{port}"
    if (not host or not host.isascii() or parts.scheme not in ("http", "https")
            or given != f"{parts.scheme}://{host}"):
        raise ValueError("expected origins as a browser writes them, such as https://face.example")
    return given


_Switch = Annotated[bool, BeforeValidator(_switch)]
_IdleS = Annotated[float, Field(ge=5, le=3600, allow_inf_nan=False)]


class KioskSettings(BaseModel):
    """Every setting may be given as `--kiosk-NAME` or `DENSEFACE_KIOSK_NAME`; the flag wins."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    address: Annotated[Address, BeforeValidator(_address)] = ("127.0.0.1", 8080)
    """Where the page is served: IP address and port; port 0 is any free one."""
    certificate: Path | None = None
    """The page's TLS certificate with its chain, a PEM file."""
    key: Path | None = None
    """The certificate's secret key, a PEM file."""
    proxy: Annotated[tuple[Annotated[str, BeforeValidator(_origin)], ...],
                     Field(max_length=16), BeforeValidator(_split)] = ()
    """Origins by which browsers reach the page if not by its address, as through a reverse proxy:
    `https://face.example`, several with commas."""
    folder: Path = Field(
        default_factory=lambda: user_folder("state") / "kiosk")
    """Folder of what the kiosk keeps, mode 700: the operator's token, withdrawals under way."""
    lan: Annotated[Address | None, BeforeValidator(_address)] = None
    """Where faces are fetched by link: IP address and port; None for no links."""
    lan_certificate: Path | None = None
    """The TLS certificate of these links, a PEM file."""
    lan_key: Path | None = None
    """The secret key of that."""
    lan_url: Annotated[str, BeforeValidator(_origin)] | None = None
    """Origin by which visitors' telephones reach these links, `https://face.example:8443`; None for
    the address of the network that is up."""
    link_uses: Annotated[int, Field(ge=1, le=1000)] = 5
    """Files that are fetched by one link."""
    link_minutes: Annotated[float, Field(gt=0, le=10080, allow_inf_nan=False)] = 30.0
    """Time after which a link ends, minutes."""
    countdown: Annotated[int, Field(ge=0, le=10)] = 3
    """Seconds that are counted down before the picture; 0 for none."""
    sound: _Switch = False
    """Whether the page plays sounds."""
    speech: _Switch = True
    """Whether hints may be spoken."""
    auto: _Switch = True
    """Whether the picture is taken by itself when all is well."""
    consent: _Switch = True
    """Whether a visitor is asked before the sensor is."""
    consent_text: Path | None = None
    """The operator's own words: JSON, `{"version": "...", "text": {"en": ["...", ...], ...}}`."""
    languages: Annotated[tuple[Language, ...], Field(min_length=1, max_length=64),
                         BeforeValidator(_split)] = ("en", "de", "fr", "es", "zh", "ar")
    """Those that are offered; the first is the default."""
    measurements: _Switch = False
    """Whether lengths on the face are shown."""
    button: Path | None = None
    """Input device of a button, `/dev/input/by-id/...`; None for keyboard and screen alone."""
    button_grab: _Switch = False
    """Whether the button is taken from all other programs."""
    sensor: Annotated[str, Field(pattern=PEER_NAME)] | None = None
    """Name of the sensor above the screen, where the hub has several."""
    idle_s: _IdleS = 30.0
    """Time without a touch, or a face, until a visit ends before its result, seconds."""
    result_idle_s: _IdleS = 90.0
    """The same while a face is shown, seconds."""

    @model_validator(mode="after")
    def _safe(self) -> Self:
        for certificate, key in _PAIRS:
            if (getattr(self, certificate) is None) != (getattr(self, key) is None):
                raise ValueError(f"expected both {_FLAG}{certificate.replace('_', '-')} and "
                                 f"{_FLAG}{key.replace('_', '-')}, or neither")
        if not is_loopback(self.address) and not self.certificate and not self.proxy:
            host, port = self.address
            raise ValueError(
                f"{host}:{port} can be reached from other machines: expected a TLS certificate "
                f"({_FLAG}certificate and {_FLAG}key), or a reverse proxy's origin ({_FLAG}proxy)")
        return self

    @property
    def scheme(self) -> str:
        """Of the page."""
        return "https" if self.certificate else "http"

    @property
    def url(self) -> str:
        """Where the page is; its port is 0 where that is any free one."""
        host, port = self.address
        return f"{self.scheme}://{f'[{host}]' if ':' in host else host}:{port}"

    def tls(self) -> ssl.SSLContext | None:
        """Give what the page is served by; None without a certificate. Raises SettingsError."""
        return _tls(self.certificate, self.key, "certificate")

    def lan_tls(self) -> ssl.SSLContext | None:
        """Give what links are served by; as `tls`."""
        return _tls(self.lan_certificate, self.lan_key, "lan-certificate")

    @classmethod
    def of(cls, environment: Mapping[str, str], **flags: Any) -> Self:
        """Take each setting from its flag, else the environment, else its default.

        A flag of None is not given.

        Raises
        ------
        SettingsError
            One line that names the flag or variable and what is wrong with it.
        """
        flags, given = given_settings(cls, _PREFIX, environment, flags)
        try:
            return cls(**(given | flags))
        except ValidationError as error:
            field, message = first_error(error, found=bool(error.errors()[0]["loc"]))
            name = field.partition(".")[0]
            if not name:  # of several settings together, which it names
                raise SettingsError(f"{_FLAG}address: {message}" if "reached" in message
                                    else message) from error
            where = (_FLAG + name.replace("_", "-") if name in flags else _PREFIX + name.upper())
            raise SettingsError(f"{where}: {message}") from error


def _tls(certificate: Path | None, key: Path | None, flag: str) -> ssl.SSLContext | None:
    if certificate is None or key is None:
        return None
    return tls_context(certificate, key, _FLAG + flag)
