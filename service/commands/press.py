"""`denseface press`."""

import argparse
import shlex

from denseface.service.commands import _options
from denseface.service.runtime.terminal import complain, say, suggest


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    parser.add_argument("--id", metavar="ID", dest="capture_id",
                        help="an id of your choice for the capture: pressed again while it is "
                             "kept, it is the same capture, else a new one is taken (`denseface "
                             "get ID` fetches one that is kept, and takes none)")
    parser.add_argument("--timeout", type=_options.seconds, default=60.0, metavar="S",
                        help="longest wait for the frame, and from then on for the face, seconds "
                             "(default: 60); for a hub that is not there at most "
                             f"{_options.CONNECT_S:g}")
    parser.add_argument("--sensor", type=_options.sensor_name, metavar="NAME",
                        help="take the frame of this one; `denseface status` names them "
                             "(default: the one that is best off)")
    parser.add_argument("--gate", choices=("off", "wait", "refuse", "best"), default="off",
                        help="wait for a frame that is good enough, refuse one that is not, or "
                             "take the best of --gate-timeout seconds (default: off)")
    parser.add_argument("--gate-timeout", type=_options.seconds, default=10.0, metavar="S",
                        help="longest wait for a good frame, seconds (default: 10)")
    parser.add_argument("--frames", type=_options.burst, default=1, metavar="N",
                        help="make one of N consecutive frames, at most 32 (default: 1)")
    _options.add_outputs(parser, "--save")
    _options.add_printing(parser)
    _options.add_mode(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import StoreError
    from denseface.service.export import FaceFiles
    from denseface.service.export.written import describe
    from denseface.service.tools.fetch import fetch_face

    files = FaceFiles(args.output, args.report, args.rendering, args.mode,
                      _options.export_options(args))
    with _options.client(args, _options.CONNECT_S) as client:
        capture_id = client.press(
            args.capture_id, timeout=args.timeout, sensor=args.sensor, gate=args.gate,
            gate_timeout=args.gate_timeout, frames=args.frames)
        say(capture_id, flush=True)
        face = fetch_face(client, capture_id, files, args.timeout)
    try:
        files.write(face)
    except StoreError as error:
        raise StoreError(f"{error}; the hub has the face until its retention ends: denseface get "
                         f"{capture_id} --save FILE") from error
    _options.warn(face)
    for line in describe(files, face):
        complain(line)  # stdout has the id, and nothing else
    suggest(f"denseface view {shlex.quote(str(files.output)) if files.output else capture_id}",
            "look at it")
    return 0
