"""`denseface batch`."""

import argparse
from pathlib import Path

from denseface.service.commands import _options
from denseface.service.commands._options import reading
from denseface.service.export import FORMATS

_MOST_WORKERS = 1024


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("inputs", metavar="INPUT", nargs="*",
                        help="a .npz frame, a .oni recording, or a folder: all frames, recordings "
                             "and folders of image pairs in it and below it")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR",
                        help="folder of the faces, summary.html and summary.parquet; one that is "
                             "there is gone on with")
    parser.add_argument("--every", type=_options.count, default=1, metavar="N",
                        help="each N-th frame of a recording or folder of pairs (default: 1)")
    parser.add_argument("--summary", action="store_true",
                        help="make no face: write summary.html of what DIR has")
    reading.add_reading(parser)
    reading.add_calibration(parser)
    _options.add_rotation(parser)
    parser.add_argument("--format", choices=[ending[1:] for ending in FORMATS], default="ply",
                        help="of the faces (default: ply)")
    parser.add_argument("--report", action="store_true", help="write each face's report, too")
    parser.add_argument("--preview", action="store_true",
                        help="write a picture of each face, too; where there is none, of the frame "
                             "and what looked like one")
    _options.add_export(parser)
    _options.add_recon(parser)
    parser.add_argument("--time-limit", type=_options.seconds, default=120.0, metavar="SECONDS",
                        help="of a frame; its worker is ended then (default: 120)")
    parser.add_argument("--workers", type=_options.whole(1, _MOST_WORKERS), metavar="N",
                        help="processes on this machine (default: its cores)")
    parser.add_argument("--scheduler", metavar="tls://HOST:PORT",
                        help="take the workers of this Dask scheduler, on machines that all see "
                             "INPUT and DIR by the same names")
    parser.add_argument("--tls-ca", type=Path, metavar="FILE",
                        help="certificate of who signs the scheduler's and the workers'")
    parser.add_argument("--tls-cert", type=Path, metavar="FILE", help="one's own certificate")
    parser.add_argument("--tls-key", type=Path, metavar="FILE",
                        help="its key, which nobody else may read")


def run(args: argparse.Namespace) -> int:
    import os

    from denseface.service.errors import UsageError
    from denseface.service.tools.batch.engines.clusters import TlsFiles
    from denseface.service.tools.batch.plan import Plan
    from denseface.service.tools.batch.running import Batch, Where, run_batch, write_summary

    if bool(args.inputs) == args.summary:
        raise UsageError("expected INPUT or --summary, found "
                         f"{'both' if args.summary else 'neither'}")
    if args.summary:
        return write_summary(args.out)
    tls = TlsFiles(args.tls_ca, args.tls_cert, args.tls_key)
    if args.scheduler is None and any(tls):
        raise UsageError("--tls-ca, --tls-cert or --tls-key: expected with --scheduler "
                         "tls://HOST:PORT")
    if args.scheduler is not None and args.workers is not None:
        raise UsageError("--workers is given with --scheduler: its workers are taken")
    choice = reading.frame_choice(args, _options.service_settings(args).max_frame_pixels)
    if choice.calibration:
        choice = choice._replace(calibration=choice.calibration.absolute())
    plan = Plan(choice, _options.recon_settings(args), f".{args.format}",
                _options.export_options(args), args.textured, args.report, args.preview,
                args.every)
    cores = len(os.sched_getaffinity(0))
    return run_batch(Batch(args.inputs, args.out, plan, args.time_limit),
                     Where(args.workers or cores, args.scheduler, tls))
