"""`denseface calibrate`."""

import argparse
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.commands import _options
from denseface.service.commands._options.values import wanted
from denseface.service.runtime.terminal import complain, say, suggest
from denseface.service.runtime.terminal.progress import Progress

if TYPE_CHECKING:
    from denseface.service.tools.calibration import Board, Solution

_ENDING = ".calibration.json"
_LEAST_SIDE, _MOST_SIDE = 2, 60
"""Corners or squares."""
_SQUARE_MM = (1.0, 500.0)
_ORIGINAL_MARKERS = 1024
"""Of OpenCV's dictionary ARUCO_ORIGINAL; the others' names end in their number."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--infrared", type=Path, nargs="+", required=True, metavar="PATH",
                        help="infrared images of the depth camera: files, or a folder")
    parser.add_argument("--color", type=Path, nargs="+", required=True, metavar="PATH",
                        help="images of the colour camera, taken at the same time: in the same "
                             "order, or a folder with the same names or numbers")
    board = parser.add_mutually_exclusive_group(required=True)
    board.add_argument("--board", type=_sides, metavar="9x6",
                       help="inner corners of a checkerboard: squares less one, both ways")
    board.add_argument("--charuco", type=_sides, metavar="7x5",
                       help="squares of a ChArUco board")
    parser.add_argument("--square", type=_length, required=True, metavar="MM",
                        help="side of a square, mm, as measured on the printed board")
    parser.add_argument("--marker", type=_length, metavar="MM",
                        help="side of a ChArUco board's markers, mm (default: 0.75 of a square)")
    parser.add_argument("--dictionary", type=_dictionary, default="4X4_50", metavar="NAME",
                        help="of a ChArUco board's markers (default: 4X4_50)")
    parser.add_argument("-o", "--output", type=Path, metavar=f"NAME{_ENDING}",
                        help="write the calibration")
    parser.add_argument("--sensor", metavar="SERIAL",
                        help="write it where the sensor of this serial number, USB port or URI "
                             "finds it")
    parser.add_argument("--picture", type=Path, metavar="P.png",
                        help="draw where the board was, and how far corners are off")
    parser.add_argument("--report", type=Path, metavar="R.json",
                        help="write errors, view by view")


def run(args: argparse.Namespace) -> int:
    from denseface.capture.doubts import doubts_of
    from denseface.service.tools import calibration as tool

    outputs, board = _outputs(args), _board(args)
    pairs = tool.paired_files(args.infrared, args.color)
    with Progress(f"calibrating by {len(pairs)} pairs of images"):
        views, depth_size, color_size = tool.look_for_board(
            pairs, board, _options.service_settings(args).max_frame_pixels)
        solution = tool.solve(views, board, depth_size, color_size)
    warnings = doubts_of(solution.calibration)
    report = tool.CalibrationReport.of(solution, warnings)
    for path in outputs:
        _write(path, (solution.calibration.model_dump_json(indent=2) + "\n").encode())
    if args.picture:
        _write(args.picture, tool.picture(solution))
    if args.report:
        _write(args.report, (report.model_dump_json(indent=2) + "\n").encode())
    say(*_lines(solution), *map(str, outputs))
    for warning in warnings:
        complain(f"warning: {warning}")
    for path in outputs[:1]:
        suggest(f"denseface live --calibration {shlex.quote(str(path))}", "faces by it")
    return 0


def _lines(solution: "Solution") -> list[str]:
    lines = [f"{view.name:24} " + (f"{view.rms_px:.3f} px" if view.rms_px is not None
                                   else f"left out: {view.why_not}")
             for view in solution.views]
    accuracy, pose = solution.accuracy, solution.calibration.depth_to_color
    for name, camera, off in (
            ("depth camera", solution.calibration.depth, accuracy.depth_focal_px),
            ("colour camera", solution.calibration.color, accuracy.color_focal_px)):
        lines.append(f"{name}: focal length {camera.fx:.2f}, {camera.fy:.2f} +- {off:.2f} px, "
                     f"centre {camera.cx:.2f}, {camera.cy:.2f}")
    x, y, z = pose.translation_mm
    return [*lines, f"depth to colour: {x:.2f}, {y:.2f}, {z:.2f} +- {accuracy.translation_mm:.2f} "
            f"mm, turned +- {accuracy.rotation_deg:.3f} degrees",
            f"reprojection error: {solution.rms_px:.3f} px"]


def _outputs(args: argparse.Namespace) -> list[Path]:
    from denseface.capture.identity import calibration_folder, file_name
    from denseface.service.errors import UsageError
    from denseface.service.export import check_outputs

    outputs = [args.output] if args.output else []
    if args.output and not args.output.name.endswith(_ENDING):
        raise UsageError(f"{args.output}: expected a name that ends in {_ENDING}")
    check_outputs((args.output, None), (args.picture, ".png"), (args.report, ".json"))
    if args.sensor:
        outputs.append(calibration_folder() / file_name(args.sensor))
    if not outputs:
        raise UsageError("expected -o FILE or --sensor SERIAL, where the calibration goes")
    return outputs


def _board(args: argparse.Namespace) -> "Board":
    from denseface.service.errors import UsageError
    from denseface.service.tools.calibration import Charuco, Checkerboard

    if args.board:
        columns, rows = args.board
        return Checkerboard(columns, rows, args.square)
    marker = args.square * 0.75 if args.marker is None else args.marker
    if marker >= args.square:
        raise UsageError(f"--marker {marker:g}: expected less than --square {args.square:g}")
    columns, rows = args.charuco
    name = args.dictionary
    most = _ORIGINAL_MARKERS if name == "ARUCO_ORIGINAL" else int(name.rpartition("_")[2])
    if columns * rows // 2 > most:
        raise UsageError(f"--charuco {columns}x{rows} has {columns * rows // 2} markers, "
                         f"--dictionary {name} has {most}")
    return Charuco(columns, rows, args.square, marker, args.dictionary)


def _write(path: Path, data: bytes) -> None:
    from denseface.files import write_whole
    from denseface.service.errors import StoreError, reason_of

    try:
        write_whole(path, [data])
    except OSError as error:
        raise StoreError(f"{path}: {reason_of(error)}") from error


def _sides(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,3})x(\d{1,3})", text)
    sides = tuple(map(int, found.groups())) if found else (0, 0)
    if not all(_LEAST_SIDE < side <= _MOST_SIDE for side in sides):
        raise wanted(f"columns and rows such as 9x6, {_LEAST_SIDE + 1} to {_MOST_SIDE} each", text)
    return sides[0], sides[1]


def _length(text: str) -> float:
    try:
        length = float(text)
    except ValueError:
        length = 0.0
    if not _SQUARE_MM[0] <= length <= _SQUARE_MM[1]:
        raise wanted(f"millimetres, {_SQUARE_MM[0]:g} to {_SQUARE_MM[1]:g}", text)
    return length


def _dictionary(text: str) -> str:
    name = text.upper().removeprefix("DICT_")
    if not re.fullmatch(r"[4-7]X[4-7]_(50|100|250|1000)|ARUCO_ORIGINAL", name):
        raise wanted("one of OpenCV's dictionaries such as 4X4_50", text)
    return name
