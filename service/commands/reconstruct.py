"""`denseface reconstruct`."""

import argparse
from pathlib import Path

from denseface.service.commands import _options
from denseface.service.runtime.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="INPUT", help="a .npz frame or a .oni recording")
    parser.add_argument("--frame", type=int, default=0, metavar="N",
                        help="which frame of the recording, from 0 (default: 0)")
    parser.add_argument("--frames", type=_options.burst, default=1, metavar="N",
                        help="average the depth of N frames from there on (default: 1)")
    _options.add_outputs(parser, "-o", "--output")
    parser.add_argument("--calibration", type=Path, metavar="FILE.json",
                        help="calibration that wins over the file's own")
    _options.add_recon(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.export import FaceFiles
    from denseface.service.tools.frames import read_frame

    files = FaceFiles(args.output, args.report, args.rendering)
    settings = _options.recon_settings(args)
    frame = read_frame(args.input, args.frame, args.calibration,
                       _options.service_settings(args).max_frame_pixels, args.frames)

    from denseface.recon import reconstruct

    face = reconstruct(frame, settings)
    files.write(face)
    _options.warn(face)
    report = face.report
    say(f"{report.initial_points} measured points, {report.dense_points} dense points, "
        f"{report.timings_ms['total']:.0f} ms")
    return 0
