"""`denseface info`."""

import argparse
from pathlib import Path

from denseface.service.runtime.terminal import complain, say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path,
                        help="a face in any format, a frame, a recording, a calibration or a "
                             "report")
    parser.add_argument("--json", action="store_true",
                        help="print a JSON object for each file, a line each")


def run(args: argparse.Namespace) -> int:
    import json

    from denseface.capture.errors import CaptureError
    from denseface.service.errors import FormatError
    from denseface.service.tools.info import as_lines, inspect

    status = 0
    for path in args.files:
        try:
            found = inspect(path)
        except (FormatError, CaptureError) as error:
            if len(args.files) == 1:
                raise
            complain(f"denseface info: {' '.join(str(error).split())}")
            status = 2
            continue
        say(*([json.dumps(found)] if args.json else as_lines(found)))
    return status
