"""Flags that several commands share."""

import argparse
import os
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from denseface.recon.settings import Settings
    from denseface.service.client import Client, Operator
    from denseface.service.settings import ServiceSettings

__all__ = ["add_address", "add_credentials", "add_daemon", "add_hub", "add_keys", "add_listen",
           "add_metrics", "add_recon", "add_retention", "client", "moment", "operator",
           "recon_arguments", "recon_settings", "service_settings", "start_daemon",
           "use_one_thread"]


def add_address(parser: argparse.ArgumentParser) -> None:
    """Say where the hub is."""
    parser.add_argument(
        "--address", "--hub", metavar="ADDRESS",
        help="the hub's, ipc://PATH or tcp://HOST:PORT (default: DENSEFACE_ADDRESS, "
             "else this user's own)")


def add_credentials(parser: argparse.ArgumentParser) -> None:
    """Say with which keys to go to a hub elsewhere."""
    parser.add_argument("--key", type=Path, metavar="FILE",
                        help="one's own secret key, for a hub on another machine "
                             "(default: DENSEFACE_KEY)")
    parser.add_argument("--hub-key", type=Path, metavar="FILE",
                        help="the public key of that hub (default: DENSEFACE_HUB_KEY)")


def add_listen(parser: argparse.ArgumentParser) -> None:
    """Say where other machines are let in, and which."""
    parser.add_argument("--listen", action="append", metavar="tcp://HOST:PORT",
                        help="listen here too, for those with an allowed key; may be repeated "
                             "(default: DENSEFACE_LISTEN)")
    add_keys(parser)
    parser.add_argument("--key", type=Path, metavar="FILE",
                        help="the hub's secret key (default: DENSEFACE_KEY, else hub.secret in the "
                             "folder of keys)")


def add_keys(parser: argparse.ArgumentParser) -> None:
    """Say where keys are kept."""
    parser.add_argument("--keys", type=Path, metavar="DIR",
                        help="folder of keys (default: DENSEFACE_KEYS, else denseface/keys in this "
                             "user's configuration)")


def add_daemon(parser: argparse.ArgumentParser) -> None:
    """Say how a process logs."""
    parser.add_argument("--log", choices=("text", "json"), default="text",
                        help="form of the log on stderr (default: text)")


def add_hub(parser: argparse.ArgumentParser) -> None:
    """Say where things are kept."""
    parser.add_argument("--data", type=Path, metavar="DIR",
                        help="folder of frames and faces (default: DENSEFACE_DATA, else this "
                             "user's data folder)")


def add_retention(parser: argparse.ArgumentParser) -> None:
    """Say for how long."""
    parser.add_argument("--retention", metavar="TIME",
                        help="remove captures so long after their outcome: 24h, 90m, 7d, or off "
                             "(default: DENSEFACE_RETENTION, else 24h)")


def add_metrics(parser: argparse.ArgumentParser) -> None:
    """Say where the figures are."""
    parser.add_argument("--metrics", metavar="PORT",
                        help="serve /metrics and /healthz on this loopback port; 0 chooses one and "
                             "logs it (default: DENSEFACE_METRICS, else off)")


def moment(text: str) -> datetime:
    """Read a time."""
    from denseface.service.runtime.parsing import parse_time

    try:
        return parse_time(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def add_recon(parser: argparse.ArgumentParser) -> None:
    """Say how faces are made."""
    parser.add_argument("--preset", metavar="NAME", help="paper, faithful or best (default: best)")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="changes",
                        help="change one setting of the reconstruction; may be repeated")


def recon_arguments(args: argparse.Namespace) -> list[str]:
    """Give the flags of `add_recon` again, for a child process."""
    given = ["--preset", args.preset] if args.preset else []
    for change in args.changes:
        given += ["--set", change]
    return given


def recon_settings(args: argparse.Namespace) -> "Settings":
    """Read `--preset` and `--set`.

    Raises
    ------
    UsageError
        One line that names the setting, what was found and what was expected.
    """
    from pydantic import ValidationError

    from denseface.recon.settings import Settings
    from denseface.service.errors import UsageError, first_error

    given = {"preset": args.preset} if args.preset else {}
    for change in args.changes:
        name, equals, value = change.partition("=")
        if not equals or name not in Settings.model_fields:
            raise UsageError(f"--set {change}: expected NAME=VALUE with NAME one of "
                             f"{', '.join(Settings.model_fields)}")
        given[name] = value
    try:
        return Settings.model_validate(given)
    except ValidationError as error:
        name, message = first_error(error, found=True)
        flag = "--preset" if name == "preset" and args.preset else f"--set {name}"
        raise UsageError(f"{flag}: {message}") from error


def service_settings(args: argparse.Namespace) -> "ServiceSettings":
    """Put the flags over the environment."""
    from denseface.service.settings import ServiceSettings

    names = ("address", "data", "key", "hub_key", "keys", "listen", "retention", "metrics")
    return ServiceSettings.of(
        os.environ, **{name: getattr(args, name, None) for name in names})


def client(args: argparse.Namespace) -> "Client":
    """Connect as the flags of `add_address` and `add_credentials` say."""
    from denseface.service.client import Client

    return Client(args.address, key=args.key, hub_key=args.hub_key)


def operator(args: argparse.Namespace) -> "Operator":
    """Connect as `client`, to remove too."""
    from denseface.service.client import Operator

    return Operator(args.address, key=args.key, hub_key=args.hub_key)


def start_daemon(args: argparse.Namespace, name: str) -> None:
    """Do what every process of the service does first."""
    from denseface.service.runtime import failpoints
    from denseface.service.runtime.logging import configure
    from denseface.service.runtime.signals import die_with_parent

    die_with_parent()
    configure(args.log, name)
    failpoints.arm(os.environ)


def use_one_thread() -> None:
    """Keep the libraries of this process to one thread, unless the user says otherwise.

    They read it once, when NumPy is first imported: to be called before.
    """
    from denseface.service.daemons.supervisor import ONE_THREAD

    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
