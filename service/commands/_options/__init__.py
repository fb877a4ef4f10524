"""Flags that several commands share, and what is made of them."""

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.commands._options.values import (
    burst,
    count,
    file_mode,
    millimetres,
    part,
    percent,
    print_height,
    seconds,
    sensor_name,
    timestamp,
    wall,
    whole,
)
from denseface.service.export import FORMATS, ExportOptions
from denseface.service.export.options import HOLES, PLAIN
from denseface.service.export.printing.choice import SOLIDS, Printing

__all__ = [
    "add_client", "add_export", "add_hub", "add_keys", "add_log", "add_mode", "add_outputs",
    "add_printing", "add_recon", "add_rotation", "add_source", "burst", "client", "count",
    "export_options", "file_mode", "millimetres", "operator", "part", "percent", "recon_settings",
    "repeated", "seconds", "sensor_name", "service_settings", "timestamp", "warn", "whole",
]

if TYPE_CHECKING:
    from denseface.recon.face import Face
    from denseface.recon.settings import Settings
    from denseface.service.client import Client, Operator
    from denseface.service.settings import ServiceSettings

CONNECT_S = 10.0
"""Longest wait of a command for a hub that is not there, seconds: one that starts takes a few."""


def add_client(parser: argparse.ArgumentParser) -> None:
    """Add `--address`, `--key` and `--hub-key`, of a process that connects to a hub."""
    _add_address(parser)
    parser.add_argument("--key", type=Path, metavar="FILE",
                        help="one's own secret key, for a hub on another machine "
                             "(default: DENSEFACE_KEY)")
    parser.add_argument("--hub-key", metavar="FILE",
                        help="the public key of that hub, or its 40 characters (default: "
                             "DENSEFACE_HUB_KEY)")


def add_hub(parser: argparse.ArgumentParser) -> None:
    """Add all flags of the hub."""
    _add_address(parser)
    parser.add_argument("--listen", action="append", metavar="tcp://HOST:PORT",
                        help="listen here too, for those with an allowed key; may be repeated "
                             "(default: DENSEFACE_LISTEN)")
    add_keys(parser)
    parser.add_argument("--key", type=Path, metavar="FILE",
                        help="the hub's secret key (default: DENSEFACE_KEY, else hub.secret in the "
                             "folder of keys)")
    parser.add_argument("--data", type=Path, metavar="DIR",
                        help="folder of frames and faces (default: DENSEFACE_DATA, else this "
                             "user's data folder)")
    parser.add_argument("--retention", metavar="TIME",
                        help="remove captures so long after their outcome: 24h, 90m, 7d, or off "
                             "(default: DENSEFACE_RETENTION, else 24h)")
    parser.add_argument("--metrics", metavar="PORT",
                        help="serve /metrics and /healthz on this loopback port; 0 chooses one and "
                             "logs it (default: DENSEFACE_METRICS, else off)")
    add_recon(parser)
    add_log(parser)


def _add_address(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--address", "--hub", metavar="ADDRESS",
        help="the hub's, ipc://PATH or tcp://HOST:PORT (default: DENSEFACE_ADDRESS, "
             "else this user's own)")


def add_keys(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--keys", type=Path, metavar="DIR",
                        help="folder of keys (default: DENSEFACE_KEYS, else denseface/keys in this "
                             "user's configuration)")


def add_log(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--log", choices=("text", "json"), default="text",
                        help="form of the log on stderr (default: text)")


def add_source(parser: argparse.ArgumentParser, *, rotated: bool = True) -> None:
    """Add `--source`, `--calibration` and, where frames are `rotated`, `--rotate`."""
    parser.add_argument("--source", default="openni2:", metavar="URI",
                        help="openni2: for the first sensor, openni2:NAME for that of a serial "
                             "number, USB port or address, or a .oni or .npz file or a folder "
                             "of .npz, played by options: FILE?rate=real&end=stop&frame=N "
                             "(default: openni2:)")
    parser.add_argument("--calibration", type=Path, metavar="FILE",
                        help="calibration that wins over the source's own")
    if rotated:
        add_rotation(parser)


def add_rotation(
    parser: argparse.ArgumentParser, action: str = "store", default: int | None = 0
) -> None:
    """Add `--rotate`: how a sensor on its side, or its recording, is turned upright."""
    parser.add_argument("--rotate", type=int, choices=(0, 90, 180, 270), action=action,
                        default=default,
                        help="degrees by which images are turned clockwise, as of a sensor on its "
                             "side or upside down (default: 0)")


def add_outputs(parser: argparse.ArgumentParser, *flags: str) -> None:
    """Add `flags`, those of the cloud or mesh, `--report` and `--preview`."""
    *endings, last = FORMATS
    parser.add_argument(*flags, type=Path, metavar="OUT", dest="output",
                        help=f"write the face: {' '.join(endings)} or {last}")
    parser.add_argument("--report", type=Path, metavar="R.json", help="write the report")
    parser.add_argument("--preview", type=Path, metavar="P.png", dest="rendering",
                        help="write a picture")


def add_export(parser: argparse.ArgumentParser) -> None:
    """Add `--textured`, `--compact`, `--holes` and `--copyright`, of a mesh, and `add_printing`."""
    parser.add_argument("--textured", action="store_true",
                        help="take the mesh's colours from the colour image, at full resolution: "
                             ".glb or .obj")
    parser.add_argument("--compact", action="store_true",
                        help="pack a .glb to a tenth, for browsers (EXT_meshopt_compression)")
    parser.add_argument("--holes", choices=HOLES, default=PLAIN.holes,
                        help="of a mesh: leave them open, or close them (default: leave)")
    parser.add_argument("--copyright", metavar="TEXT", default=PLAIN.copyright,
                        help="who has the rights in a .glb")
    add_printing(parser)


def add_printing(parser: argparse.ArgumentParser) -> None:
    """Add `--solid`, `--wall` and `--height`, of a face that is to be printed."""
    parser.add_argument("--solid", choices=SOLIDS, default=PLAIN.printing.solid,
                        help="of an .stl or .3mf, which are for 3D printing: the face on a plate, "
                             "as a hollow mask, or, of an .stl, the open surface as the camera saw "
                             "it (default: plate)")
    parser.add_argument("--wall", type=wall, metavar="MM",
                        default=PLAIN.printing.wall_mm,
                        help="thickness of that plate, or of the mask's wall (default: 2)")
    parser.add_argument("--height", type=print_height, metavar="MM",
                        help="of the face, as it is printed (default: life size)")


def export_options(args: argparse.Namespace) -> ExportOptions:
    """Read what `add_export` or `add_printing` added, but for `--textured`; raises `UsageError`."""
    printing = Printing(args.solid, args.wall, args.height)
    if not hasattr(args, "holes"):
        return ExportOptions(printing=printing)
    return ExportOptions(args.holes, None, args.compact, args.copyright, printing)


def add_mode(parser: argparse.ArgumentParser) -> None:
    """Add `--mode`, of the files that `--save` writes: pictures of people, whatever the umask."""
    parser.add_argument("--mode", type=file_mode, default=0o600, metavar="OCTAL",
                        help="mode of the files that are written, such as 640 (default: 600, for "
                             "this user alone)")


SETTINGS = ("r0_factor", "smoothing", "detail_factor", "symmetry", "shading", "prior", "neighbors",
            "pixel_mm", "ratio")
"""Fields of `Settings` beside the preset: the help is to be quick, and imports none of them."""


def add_recon(parser: argparse.ArgumentParser) -> None:
    """Add `--preset` and `--set`: how faces are reconstructed."""
    parser.add_argument("--preset", metavar="NAME",
                        help="paper, faithful, light or best (default: best)")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE",
                        help="change one setting of the reconstruction, such as smoothing=8; may "
                             f"be repeated: {', '.join(SETTINGS)} (docs/settings.md)")


def recon_settings(args: argparse.Namespace) -> "Settings":
    """Read `--preset` and `--set`; raises `UsageError`, which names the setting that is wrong."""
    from pydantic import ValidationError

    from denseface.recon.settings import Settings
    from denseface.service.errors import UsageError, first_error

    given = {"preset": args.preset} if args.preset else {}
    for change in args.set:
        name, equals, value = change.partition("=")
        if not equals or name not in Settings.model_fields:
            near = get_close_matches(name, Settings.model_fields, n=1)
            meant = f"did you mean {near[0]}? " if equals and near else ""
            raise UsageError(f"--set {change}: {meant}expected NAME=VALUE with NAME one of "
                             f"{', '.join(Settings.model_fields)}")
        given[name] = value
    try:
        return Settings.model_validate(given)
    except ValidationError as error:
        name, message = first_error(error, found=True)
        flag = "--preset" if name == "preset" and args.preset else f"--set {name}"
        raise UsageError(f"{flag}: {message}") from error


def service_settings(args: argparse.Namespace) -> "ServiceSettings":
    from denseface.service.settings import ServiceSettings

    names = ("address", "data", "key", "hub_key", "keys", "listen", "retention", "metrics")
    return ServiceSettings.of(os.environ, **{name: getattr(args, name, None) for name in names})


def client(
    args: argparse.Namespace, connect_timeout: float | None = None, *, quiet: bool = False
) -> "Client":
    """Give a client, which says on stderr that it waits for a hub, and why, unless `quiet`."""
    from denseface.service.client import Client

    return Client(args.address, key=args.key, hub_key=args.hub_key,
                  connect_timeout=connect_timeout,
                  on_waiting=None if quiet else partial(_say_waiting, args))


@contextmanager
def operator(args: argparse.Namespace) -> Iterator["Operator"]:
    """Give an operator of the hub."""
    from denseface.service.client import Operator

    with Operator(args.address, key=args.key, hub_key=args.hub_key, connect_timeout=CONNECT_S,
                  on_waiting=partial(_say_waiting, args)) as operator:
        yield operator


def _say_waiting(args: argparse.Namespace, line: str) -> None:
    from denseface.service.runtime.terminal import complain

    complain(f"denseface {args.command}: {line}")


def repeated(args: argparse.Namespace, *names: str) -> list[str]:
    """Give the flags of these names again as they were given, for a child process."""
    flags = []
    for name in names:
        value = getattr(args, name)
        if value is True:
            flags.append(f"--{name}")
        elif value not in (None, False):
            flags += [f"--{name}={one}" for one in (value if isinstance(value, list) else [value])]
    return flags


def warn(face: "Face") -> None:
    """Print what its report doubts on stderr, one line each."""
    from denseface.service.runtime.terminal import complain

    for warning in face.report.warnings:
        complain(f"warning: {warning}")
