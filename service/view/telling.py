"""What is told of a face, a frame without one, or a mesh: texts and bytes for the page."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from denseface.recon import Face, ReconstructionError
from denseface.service.export.face_grid import encode_face_grid
from denseface.service.export.provenance import frame_provenance, provenance
from denseface.service.export.reading import Mesh
from denseface.service.export.refusal import draw_refusal
from denseface.service.kiosk.conductor.measuring import measurements_of
from denseface.service.view.items import Item, Taken
from denseface.service.view.meshes import encode_mesh
from denseface.service.view.messages import Fact, Seen

__all__ = ["Told", "figures", "tell"]

_NAMES = {"generator": "Made by", "capture_id": "Capture", "captured_at": "Taken",
          "sensor": "Sensor", "source": "Source", "calibration": "Calibration",
          "settings": "Settings"}
"""Of `provenance`, for people."""


class Told(NamedTuple):
    """All that the page may ask for of one frame."""

    seen: Seen
    shape: bytes = b""
    """A face's grid or a mesh; empty where there is neither."""
    picture: bytes = b""
    """PNG of a frame that became no face; empty where there is none."""


def tell(item: Item, number: int, name: str) -> Told:
    """Take a frame of an item, and tell of it.

    Parameters
    ----------
    number : of the frame
    name : what the item is called on the page

    Raises
    ------
    UsageError
        It has no such frame.
    """
    head, taken = item.head, item.take(number)
    title = name if head.kind != "frames" or head.frames == 1 else f"{name}, frame {number}"
    if taken.mesh:
        return _mesh(title, taken.mesh, taken.info)
    return _face(title, taken.face) if taken.face else _refused(title, taken)


def _mesh(title: str, mesh: Mesh, info: Mapping[str, Any]) -> Told:
    points, triangles = mesh.points, mesh.triangles
    told = {"Format": str(info.get("format", "")), "Points": f"{len(points):,}"}
    if triangles is not None:
        told["Triangles"] = f"{len(triangles):,}"
    if len(points):
        told["Size"] = "{:.1f} x {:.1f} x {:.1f} mm".format(*np.ptp(points, axis=0))
    told["Colours"] = "none" if mesh.colors is None else "of each point"
    if "closed" in info:
        told["Closed"] = "yes" if info["closed"] else "no"
    problem = "" if len(points) else "there are no points in it"
    return Told(Seen(shape="mesh" if len(points) else "none", title=title, problem=problem,
                     figures=_facts(told), provenance=_facts(info.get("provenance", {}))),
                encode_mesh(mesh) if len(points) else b"")


def _face(title: str, face: Face) -> Told:
    report = face.report
    try:
        grid, problem = encode_face_grid(face), ""
    except ValueError as error:  # a file's arrays may lie anywhere
        grid, problem = b"", str(error)
    return Told(Seen(
        shape="face" if grid else "none", title=title, problem=problem, figures=figures(face),
        measurements=measurements_of(face) if grid else (), warnings=report.warnings,
        provenance=_facts(provenance(report)), report=report.model_dump_json(indent=2)), grid)


def _refused(title: str, taken: Taken) -> Told:
    frame, problem = taken.frame, str(taken.error)
    if frame is None:
        return Told(Seen(shape="none", title=title, problem=problem))
    candidates = taken.error.candidates if isinstance(taken.error, ReconstructionError) else ()
    return Told(
        Seen(shape="none", title=title, problem=problem, picture=True,
             warnings=frame.origin.notes, provenance=_facts(frame_provenance(frame))),
        picture=draw_refusal(frame, candidates, f"{title}: {problem}"))


def figures(face: Face) -> tuple[Fact, ...]:
    """Give the figures of a face and its report that most readers look for."""
    report, dense = face.report, face.dense
    rows, columns = dense.grid_shape
    told = {"Measured points": f"{len(face.initial):,}", "Dense points": f"{len(dense):,}"}
    if len(dense):
        middle, most = np.percentile(dense.sigma, [50, 95])
        told |= {
            "Size": "{:.0f} x {:.0f} x {:.0f} mm".format(*np.ptp(dense.points, axis=0)),
            "Distance": f"{np.median(dense.points[:, 2]):.0f} mm",
            "Standard error, median": f"{middle:.2f} mm",
            "Standard error, 19 of 20 below": f"{most:.2f} mm"}
    told |= {
        "Grid": f"{rows} x {columns}, every {dense.grid_step_mm:.2f} mm",
        "Spacing of measured points": f"{report.mean_spacing_mm:.2f} mm",
        "Noise of depth": f"{report.noise_mm:.2f} mm",
        "Levels of depth": f"{report.quantum_mm:.2f} mm apart" if report.quantum_mm else "",
        "Preset": str(report.settings.preset),
        "R0": f"{report.r0_mm:.1f} mm",
        "Smoothing": f"{report.smoothing:.3g}",
        "Sure of the face": "" if report.face_score is None else f"{report.face_score:.2f}",
        "Frames averaged": str(report.fused) if report.fused > 1 else "",
        "Depth after colour": f"{report.skew_us / 1000:.1f} ms" + (
            f" (by {report.skew_known_by})" if report.skew_known_by else ""),
        "Exposed after the press": "" if report.exposed_after_press_ms is None else (
            f"{report.exposed_after_press_ms:.0f} ms (by {report.exposure_known_by})"),
        "Time": f"{report.timings_ms['total']:.0f} ms" if "total" in report.timings_ms else "",
    }
    return _facts(told)


def _facts(told: Mapping[str, str]) -> tuple[Fact, ...]:
    return tuple(Fact(name=_NAMES.get(name, name), value=text) for name, text in told.items()
                 if text)
