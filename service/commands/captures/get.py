"""`denseface get`."""

import argparse
from pathlib import Path

from denseface.service.commands import _options
from denseface.service.runtime.terminal import complain, say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("capture_id", nargs="?", metavar="ID",
                       help="as `denseface press` printed it; `denseface list` names them")
    which.add_argument("--last", action="store_true", help="the capture that was accepted last")
    parser.add_argument("--timeout", type=_options.seconds, default=60.0, metavar="S",
                        help="longest wait for a face that is being made, seconds (default: 60)")
    _options.add_outputs(parser, "--save")
    _options.add_export(parser)
    parser.add_argument("--frame", type=Path, metavar="F.npz",
                        help="write the frame as the sensor gave it, for `denseface reconstruct`; "
                             "also where no face was found in it")
    parser.add_argument("--photo", type=Path, metavar="P.png",
                        help="write the colour image of that frame")
    _options.add_mode(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import UnknownCaptureError
    from denseface.service.export import FaceFiles
    from denseface.service.export.written import describe
    from denseface.service.tools.fetch import fetch_face
    from denseface.service.tools.frame_files import FrameFiles

    files = FaceFiles(args.output, args.report, args.rendering, args.mode,
                      _options.export_options(args), args.textured)
    frame_files = FrameFiles(args.frame, args.photo, args.mode)
    with _options.operator(args) as client:
        capture_id = args.capture_id
        if args.last:
            if not (newest := client.captures(1)):
                raise UnknownCaptureError("--last: the hub keeps no capture")
            capture_id = newest[0].capture_id
        frame = None
        if frame_files or files.textured:  # first: where there is no face, it shows why
            frame = client.get_frame(capture_id, timeout=args.timeout)
        if frame is not None and frame_files:
            frame_files.write(frame)
            for line in frame_files.describe(frame):
                complain(line)
            if not files:
                say(capture_id)
                return 0
        face = fetch_face(client, capture_id, files, args.timeout)
    files.write(face, frame)
    say(f"{capture_id} {len(face.dense)} points")
    _options.warn(face)
    for line in describe(files, face):
        complain(line)
    return 0
