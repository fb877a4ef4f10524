"""`denseface export`."""

import argparse

from denseface.service.commands import _options
from denseface.service.runtime.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="FACE.npz|ID",
                        help="a face that was written as .npz, or the id of a capture that the hub "
                             "keeps")
    _options.add_outputs(parser, "-o", "--output")
    _options.add_export(parser)
    _options.add_mode(parser)
    _options.add_client(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import UsageError
    from denseface.service.export import FaceFiles
    from denseface.service.export.written import describe
    from denseface.service.tools.faces import take_face

    files = FaceFiles(args.output, args.report, args.rendering, args.mode,
                      _options.export_options(args), args.textured)
    if not files:
        raise UsageError("-o/--output: expected OUT, or --preview or --report: what is to be "
                         "written")
    face, frame = take_face(args.input, lambda: _options.client(args, _options.CONNECT_S), files)
    files.write(face, frame)
    _options.warn(face)
    say(*describe(files, face))
    return 0
