"""Flags of the kiosk: `--kiosk-NAME` for each of its settings."""

import argparse
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from denseface.service.kiosk.settings import KioskSettings

__all__ = ["KIOSK_FLAGS", "add_kiosk", "kiosk_settings", "repeated_kiosk"]

KIOSK_FLAGS = {
    "address": ("ADDRESS", "where the page is: PORT, or IP address and port; 0 is any free port "
                           "(default: 127.0.0.1:8080)"),
    "certificate": ("FILE.pem", "TLS certificate of the page"),
    "key": ("FILE.pem", "secret key of that"),
    "proxy": ("ORIGIN", "origin by which browsers reach the page, as through a reverse proxy: "
                        "https://face.example; several with commas"),
    "folder": ("DIR", "folder of the operator's token and of what the kiosk keeps (default: "
                      "denseface/kiosk in this user's state folder)"),
    "lan": ("ADDRESS", "serve links to faces here: IP address and port (default: off)"),
    "lan-certificate": ("FILE.pem", "TLS certificate of these links"),
    "lan-key": ("FILE.pem", "secret key of that"),
    "lan-url": ("ORIGIN", "origin of these links, https://face.example:8443 (default: by the "
                          "address of the network that is up)"),
    "link-uses": ("N", "files that are fetched by one link (default: 5)"),
    "link-minutes": ("N", "minutes after which a link ends (default: 30)"),
    "countdown": ("SECONDS", "counted down before the picture; 0 for none (default: 3)"),
    "sound": ("on|off", "play sounds (default: off)"),
    "speech": ("on|off", "let hints be spoken (default: on)"),
    "auto": ("on|off", "take the picture by itself when all is well (default: on)"),
    "consent": ("on|off", "ask before the sensor is asked (default: on)"),
    "consent-text": ("FILE.json", "the operator's own words of consent"),
    "languages": ("en,de,...", "languages that are offered, the default first (default: "
                               "en,de,fr,es,zh,ar)"),
    "measurements": ("on|off", "offer lengths on the face (default: off)"),
    "button": ("DEVICE", "input device of a button, /dev/input/by-id/... (default: none)"),
    "button-grab": ("on|off", "take the button from all other programs (default: off)"),
    "sensor": ("NAME", "the sensor above the screen (default: the one that is best off)"),
    "idle-s": ("SECONDS", "without a touch or a face until a visit ends (default: 30)"),
    "result-idle-s": ("SECONDS", "the same while a face is shown (default: 90)"),
}
"""Flag -> what stands for its value, and its help."""


def add_kiosk(parser: argparse.ArgumentParser) -> None:
    """Add `--kiosk-NAME` for each setting."""
    group = parser.add_argument_group(
        "kiosk", "each also as DENSEFACE_KIOSK_NAME; needs the extra [kiosk]")
    for name, (metavar, text) in KIOSK_FLAGS.items():
        group.add_argument(f"--kiosk-{name}", metavar=metavar, help=text)


def kiosk_settings(args: argparse.Namespace) -> "KioskSettings":
    """Read the flags, where there are any, and the environment.

    Raises SettingsError, which names what is wrong.
    """
    from denseface.service.kiosk.settings import KioskSettings

    return KioskSettings.of(os.environ, **{
        name.replace("-", "_"): _given(args, name) for name in KIOSK_FLAGS})


def repeated_kiosk(args: argparse.Namespace) -> list[str]:
    """Give the flags again as they were given, for a child process."""
    return [f"--kiosk-{name}={value}" for name in KIOSK_FLAGS
            if (value := _given(args, name)) is not None]


def _given(args: argparse.Namespace, name: str) -> str | None:
    value: str | None = getattr(args, f"kiosk_{name.replace('-', '_')}", None)
    return value
