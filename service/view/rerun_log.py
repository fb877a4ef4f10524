"""Faces and frames to rerun: cameras with their images, clouds, meshes, report, frame after frame.

Everything is in metres, as rerun takes lengths, in the depth camera's frame (x right, y down, z
forward). `docs/howto/view.md` says what is logged where.
"""

import os
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from denseface.capture import CameraModel, RgbdFrame
from denseface.recon import Face
from denseface.recon.arrays import Bytes, Floats
from denseface.service.errors import StoreError, UsageError, reason_of
from denseface.service.export.mesh import triangulate
from denseface.service.export.reading import Mesh
from denseface.service.runtime.terminal import say
from denseface.service.runtime.terminal.progress import Progress
from denseface.service.view.items import Item, Taken
from denseface.service.view.shelf import short_names
from denseface.service.view.telling import figures

__all__ = ["SIGMA_RANGE_MM", "log_items", "sigma_colors", "to_rerun", "viewer_command",
           "written"]

SIGMA_RANGE_MM = 0.5, 4.0
"""Standard errors at the ends of the colours' scale, as the page has it."""
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
_M = 1e-3
"""Of a millimetre, metres."""
_PLANE_M = 0.2
"""How far before the camera its image is drawn, metres."""


def to_rerun(items: Sequence[Item], number: int | None, save: Path | None, *, viewer: bool) -> int:
    """Log items, say what came of it, and give the exit status: 1 where there is nothing to see.

    Parameters
    ----------
    items, number : as of `log_items`
    save : file to write, `.rrd`
    viewer : whether rerun's viewer shows them; it is waited for until it is closed

    Raises
    ------
    StoreError
        The file cannot be written.
    UsageError
        The viewer cannot be started.
    """
    command = viewer_command() if viewer else []
    stream = rr.RecordingStream("denseface")
    with TemporaryDirectory(prefix="denseface-") as folder:
        path = save or Path(folder, "denseface.rrd")
        with written(stream, path):
            frames, shapes = log_items(stream, items, number)
        say(f"{frames} frame{'s' * (frames != 1)}, {shapes} to be seen"
            + (f"; {save}: `rerun {save}` shows it" if save else ""), flush=True)
        if viewer and shapes:
            _show([*command, str(path)], Path(folder, "log"))
    return 0 if shapes else 1


@contextmanager
def written(stream: rr.RecordingStream, path: Path) -> Iterator[None]:
    """Write what is logged inside the `with` block to a file: whole, or it is not there.

    Raises
    ------
    StoreError
        It cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        stream.save(part)
        yield
        stream.disconnect()  # writes what is left
        part.replace(path)
    except (OSError, RuntimeError) as error:
        raise StoreError(f"{path}: {reason_of(error)}") from error
    finally:
        part.unlink(missing_ok=True)


def viewer_command() -> list[str]:
    """Give how rerun's viewer is started; a file follows.

    Raises
    ------
    UsageError
        There is none, or no screen for it.
    """
    beside = Path(sys.executable).with_name("rerun")
    found = str(beside) if beside.exists() else which("rerun")
    if found is None:
        raise UsageError("--rerun: there is no program `rerun`; pip install rerun-sdk brings it")
    if sys.platform == "linux" and not any(os.environ.get(name) for name in _SCREENS):
        raise UsageError("--rerun: no screen here; --save OUT.rrd writes a file for it")
    # Of itself it listens on all addresses of the machine, for whoever wants to follow.
    return [found, "--bind", "127.0.0.1", "--port", "auto"]


def _show(command: list[str], log: Path) -> None:
    """Run the viewer until it is closed. It reads a file: a stream could be read by others, too."""
    with log.open("wb") as said:
        status = subprocess.run(command, check=False, stdout=said, stderr=said,
                                stdin=subprocess.DEVNULL).returncode
    if status:
        lines = log.read_text(errors="replace").split("\n")
        errors = [line for line in lines if line.startswith("Error")] or [
            line for line in lines if line] or [f"status {status}"]
        raise UsageError(f"--rerun: rerun's viewer failed: {errors[-1]}")


def log_items(
    stream: rr.RecordingStream, items: Sequence[Item], number: int | None
) -> tuple[int, int]:
    """Log items, and give how many frames and how many faces and meshes that were.

    Parameters
    ----------
    stream : is written to
    items : what is looked at; several have a root each, of their names
    number : of the frame that is taken of each; None for all
    """
    names = short_names([item.head.name for item in items])
    roots = [[name] if len(items) > 1 else [] for name in names]
    stream.send_blueprint(_blueprint(roots))
    frames = shapes = 0
    total = sum(item.head.frames or 1 for item in items) if number is None else len(items)
    with Progress("logging", total=total, unit="frames") as progress:
        for item, root, name in zip(items, roots, names, strict=True):
            stream.log([*root], rr.ViewCoordinates.RDF, static=True)
            for taken in _taken(item, number):
                stream.reset_time()
                stream.set_time("frame", sequence=taken.number)
                _log(stream, root, name, taken)
                frames += 1
                shapes += bool(taken.face or taken.mesh)
                progress.advance()
    return frames, shapes


def _taken(item: Item, number: int | None) -> Iterable[Taken]:
    one = item.head.frames == 1 and item.head.kind != "frames"
    return item.each() if number is None else [item.take(0 if one else number)]


def _log(stream: rr.RecordingStream, root: list[str], name: str, taken: Taken) -> None:
    if taken.frame is not None:
        _log_frame(stream, root, taken.frame)
    if taken.face is not None:
        _log_face(stream, root, name, taken.face)
    elif taken.mesh is not None:
        _log_mesh(stream, [*root, "mesh"], taken.mesh)
    else:
        # What was seen in the frame before is not in this one.
        stream.log([*root, "face"], rr.Clear(recursive=True))
        stream.log([*root, "report"], rr.TextDocument(f"No face: {taken.error}"))


def _log_frame(stream: rr.RecordingStream, root: list[str], frame: RgbdFrame) -> None:
    if frame.origin.captured_at:
        stream.set_time("captured", timestamp=np.datetime64(
            frame.origin.captured_at.removesuffix("Z").split("+")[0], "ns"))
    counts_per_m = 1e6 / frame.depth_meaning.unit_um
    stream.log([*root, "depth"], _pinhole(frame.depth_camera),
               rr.DepthImage(frame.depth, meter=counts_per_m))
    if frame.color is None:
        return
    pose = frame.depth_to_color
    stream.log(
        [*root, "color"],
        rr.Transform3D(translation=np.array(pose.translation_mm) * _M,
                       mat3x3=np.array(pose.rotation),
                       relation=rr.TransformRelation.ChildFromParent),
        _pinhole(frame.calibration.color), rr.Image(frame.color))


def _pinhole(camera: CameraModel) -> rr.Pinhole:
    """Give a camera without its distortion, which rerun has no place for."""
    return rr.Pinhole(
        image_from_camera=np.array(
            [[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]]),
        resolution=[camera.width, camera.height], camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=_PLANE_M)


def _log_face(stream: rr.RecordingStream, root: list[str], name: str, face: Face) -> None:
    initial, dense, report = face.initial, face.dense, face.report
    points = dense.points * np.float32(_M)
    x, y, width, height = report.face_box
    stream.log([*root, "color", "face_box"], rr.Boxes2D(
        array=[[x, y, width, height]], array_format=rr.Box2DFormat.XYWH))
    stream.log([*root, "face", "measured"], rr.Points3D(
        initial.points * np.float32(_M), colors=initial.colors,
        radii=report.mean_spacing_mm * _M * 0.4))
    stream.log([*root, "face", "dense"],
               rr.Points3D(points, colors=dense.colors, radii=dense.grid_step_mm * _M * 0.5),
               rr.AnyValues(sigma_mm=dense.sigma))
    triangles = triangulate(dense)
    for place, colors in (("mesh", dense.colors), ("sigma", sigma_colors(dense.sigma))):
        stream.log([*root, "face", place], rr.Mesh3D(
            vertex_positions=points, triangle_indices=triangles, vertex_normals=dense.normals,
            vertex_colors=colors))
    stream.log([*root, "report"], rr.TextDocument(
        _markdown(name, face), media_type=rr.MediaType.MARKDOWN))
    for what, value in (("noise_mm", report.noise_mm), ("dense_points", len(dense)),
                        ("median_sigma_mm", float(np.median(dense.sigma)) if len(dense) else 0.0),
                        ("total_ms", report.timings_ms.get("total", 0.0))):
        stream.log([*root, "figures", what], rr.Scalars(float(value)))


def _log_mesh(stream: rr.RecordingStream, path: list[object], mesh: Mesh) -> None:
    points = mesh.points * np.float32(_M)
    if mesh.triangles is None:
        stream.log(path, rr.Points3D(points, colors=mesh.colors))
    else:
        stream.log(path, rr.Mesh3D(vertex_positions=points, triangle_indices=mesh.triangles,
                                   vertex_colors=mesh.colors))


def sigma_colors(sigma: Floats) -> Bytes:
    """Colour standard errors, mm, as the page does: viridis, even in the logarithm, (n, 3) RGB."""
    low, high = SIGMA_RANGE_MM
    at = np.log(np.clip(sigma, low, high) / low) / np.log(high / low)
    shades = cv2.applyColorMap(np.rint(255 * at).astype(np.uint8)[:, None], cv2.COLORMAP_VIRIDIS)
    return np.ascontiguousarray(shades[:, 0, ::-1])


def _markdown(name: str, face: Face) -> str:
    rows = [f"| {fact.name} | {fact.value} |" for fact in figures(face)]
    warned = [f"- {warning}" for warning in face.report.warnings]
    return "\n".join([f"# {name}", *warned, "", "| | |", "|---|---|", *rows, "", "```json",
                      face.report.model_dump_json(indent=2), "```"])


def _blueprint(roots: list[list[str]]) -> rrb.Blueprint:
    """Lay out a view of each item: the mesh with the cameras; beside it sigma, images, report."""
    rows = []
    for root in roots:
        origin = "/" + "/".join(rr.escape_entity_path_part(part) for part in root)
        below = origin.rstrip("/")
        name = root[0] if root else "face"
        rows.append(rrb.Horizontal(
            rrb.Tabs(
                rrb.Spatial3DView(origin=origin, name=name, contents=[
                    f"+ {below}/**", f"- {below}/face/sigma", f"- {below}/face/dense",
                    f"- {below}/face/measured", f"- {below}/depth/**"]),
                rrb.Spatial3DView(origin=origin, name="sigma", contents=[f"+ {below}/face/sigma"]),
                rrb.Spatial3DView(origin=origin, name="measured",
                                  contents=[f"+ {below}/face/measured"]),
                rrb.Spatial3DView(origin=origin, name="dense", contents=[f"+ {below}/face/dense"])),
            rrb.Vertical(rrb.Spatial2DView(origin=f"{below}/color", name="colour"),
                         rrb.Spatial2DView(origin=f"{below}/depth", name="depth"),
                         rrb.TextDocumentView(origin=f"{below}/report", name="report"),
                         row_shares=[2, 2, 3]),
            column_shares=[3, 2]))
    return rrb.Blueprint(rrb.Vertical(*rows), collapse_panels=True)
