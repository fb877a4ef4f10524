"""`denseface press`."""

import argparse

from denseface.service.commands import _options
from denseface.service.runtime.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    parser.add_argument("--id", metavar="ID", dest="capture_id",
                        help="id of the capture; the same one again is the same capture")
    parser.add_argument("--timeout", type=_options.seconds, default=60.0, metavar="S",
                        help="longest wait for the face, seconds (default: 60)")
    _options.add_outputs(parser, "--save")
    _options.add_mode(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.export import FaceFiles

    files = FaceFiles(args.output, args.report, args.rendering, args.mode)
    with _options.client(args) as client:
        capture_id = client.press(args.capture_id, timeout=args.timeout)
        say(capture_id, flush=True)
        face = client.get(capture_id, timeout=args.timeout)
    files.write(face)
    return 0
