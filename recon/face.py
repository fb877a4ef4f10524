"""Seeds, and the result: initial cloud, dense cloud, report."""

from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AwareDatetime, BaseModel, ConfigDict, FailFast, Field, field_validator

from denseface.arguments import describe
from denseface.capture.frame import DepthRounding
from denseface.checked_model import CheckedModel
from denseface.html_repr import html_repr
from denseface.recon import thumbnail
from denseface.recon.arrays import Bytes, Floats, Ints
from denseface.recon.candidates import Box, FaceCandidate
from denseface.recon.settings import Settings
from denseface.short_repr import short_repr

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from trimesh import Trimesh

__all__ = [
    "Box", "Consent", "DenseCloud", "Face", "FaceCandidate", "PointCloud", "Report", "Seeds",
]


@dataclass(frozen=True, eq=False, repr=False)
class PointCloud:
    """Coloured points.

    Attributes
    ----------
    points : (n, 3) float32, mm, depth camera frame
    colors : (n, 3) uint8, RGB

    Raises
    ------
    ValueError
        Where an array's shape or dtype is not as above, or a coordinate is not finite.
    TypeError
        Where one is no array.
    """

    points: Floats
    colors: Bytes

    def __post_init__(self) -> None:
        _check_array("points", self.points)
        _check("points", self.points, np.float32, (len(self.points), 3))
        _check("colors", self.colors, np.uint8, (len(self.points), 3))

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        return short_repr(self, f"{len(self):,} points", _extent(self.points))

    def _repr_html_(self) -> str:
        return html_repr(type(self).__name__, self._rows(), self._pictures())

    def to_open3d(self) -> Any:
        """Give an `open3d.geometry.PointCloud`: mm, camera frame, with colours, normals if any.

        Raises
        ------
        MissingPackageError
            Open3D is not installed.
        """
        return _call("to_open3d_cloud", self)

    def _rows(self) -> list[tuple[str, str]]:
        return [("points", f"{len(self):,}"), ("extent", _extent(self.points)),
                ("distance", _distance(self.points))]

    def _pictures(self) -> list[tuple[str, Bytes]]:
        return [("colors", thumbnail.seen_from_the_camera(self.points, self.colors))]


@dataclass(frozen=True, eq=False, repr=False)
class Seeds:
    """The measured points of the face, in the order of the depth image's rows.

    Attributes
    ----------
    points : (n, 3) float32, mm, depth camera frame
    colors : (n, 3) uint8, RGB; the neighbours' mean where the colour camera does not see the
        point, and along the outline where the background mixes in
    pixels : (n, 2) int32, (row, column) in the depth image
    """

    points: Floats
    colors: Bytes
    pixels: Ints

    def __repr__(self) -> str:
        return short_repr(self, f"{len(self.points):,} points", _extent(self.points))


@dataclass(frozen=True, eq=False, repr=False)
class DenseCloud(PointCloud):
    """The seeds propagated over a regular (X, Y) grid.

    Attributes
    ----------
    normals : (n, 3) float32, unit length, toward the camera, from the fitted surface's gradient
    sigma : (n,) float32, mm, positive: the standard error along the viewing ray
    cells : (n, 2) int32, (row, column) of each point on the grid, sorted by row, then column
    grid_shape : (rows, columns) of that grid
    grid_step_mm : distance of neighbouring grid points, mm
    """

    normals: Floats
    sigma: Floats
    cells: Ints
    grid_shape: tuple[int, int]
    grid_step_mm: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("normals", self.normals, np.float32, (len(self.points), 3))
        _check("sigma", self.sigma, np.float32, (len(self.points),))
        if len(self.sigma) and self.sigma.min() <= 0:
            raise ValueError("sigma must be positive")
        _check("cells", self.cells, np.int32, (len(self.points), 2))
        row, column = _largest(self.cells)
        if len(self.cells) and (self.cells.min() < 0 or row >= self.grid_shape[0]
                                or column >= self.grid_shape[1]):
            raise ValueError(f"cells must lie on the {self.grid_shape} grid")

    def __repr__(self) -> str:
        rows, columns = self.grid_shape
        return short_repr(
            self, f"{len(self):,} points", _extent(self.points), _sigma(self),
            f"grid {rows}x{columns} every {self.grid_step_mm:.2f} mm")

    def _rows(self) -> list[tuple[str, str]]:
        rows, columns = self.grid_shape
        return [*super()._rows(), ("sigma", _spread_of_sigma(self)),
                ("grid", f"{rows} x {columns}, every {self.grid_step_mm:.2f} mm")]

    def _pictures(self) -> list[tuple[str, Bytes]]:
        looks = ("colors", self.colors), ("relief", thumbnail.relief(self.normals))
        return [(name, thumbnail.seen_on_the_grid(self.cells, self.grid_shape, colors))
                for name, colors in looks]


_PAIRS = 64
"""NumPy compares long rows many numbers at once, and short ones one by one."""
MAX_STEP = 20.0
"""Largest step in depth within a triangle of neighbours of the grid, in grid steps: more is a gap
between two surfaces. A slope of 14, the steepest bridge that is kept, makes that along a diagonal.
"""
STAGES = ("overview", "detection", "registration", "segmentation", "neighbors", "rbf",
          "judgement", "propagation")
"""The stages of a reconstruction, in order: names in `Report.timings_ms`, beside `total`."""


class Consent(CheckedModel):
    """What a person agreed to before the picture, as the press said; the hub keeps it."""

    model_config = ConfigDict(allow_inf_nan=False)

    text_version: Annotated[str, Field(min_length=1, max_length=64)]
    """Of the text that was read."""
    language: Annotated[str, Field(pattern=r"^[A-Za-z]{2,8}(-[A-Za-z0-9]{1,8}){0,7}$")]
    """In which it was read: BCP 47."""
    retention_s: Annotated[float, Field(gt=0, le=1e10)] | None = None
    """What was promised: nothing is kept longer than so many seconds after the press. None where
    no time was named."""
    at: AwareDatetime
    """When it was given, UTC; in JSON ISO 8601."""

    @field_validator("at")
    @classmethod
    def _utc(cls, given: datetime) -> datetime:
        try:
            return given.astimezone(UTC)
        except OverflowError as error:
            raise ValueError("this time does not exist in UTC") from error


class Report(BaseModel):
    """What was done to the frame, as written by `--report`."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    capture_id: str = ""
    face_box: Box
    """x, y, width, height; pixels of the colour image."""
    # FailFast: of an invalid report one error is enough, each costs a thousand bytes.
    candidates: Annotated[tuple[FaceCandidate, ...], FailFast()]
    """Every box the detector weighed, the chosen one first. Nobody farther is looked for, but where
    the nearest was none or may be none."""
    initial_points: int
    dense_points: int
    mean_spacing_mm: float
    r0_mm: float
    smoothing: Annotated[float, Field(ge=0)] = 0.0
    """lambda of the fit: that of the settings, or what the noise asked for."""
    noise_mm: float
    """Standard deviation of the noise of depth, measured in the frame."""
    noise_correlation_px: Annotated[float, Field(ge=0)] = 0.0
    """How far noise is alike: standard deviation of the Gaussian that makes white noise so; 0 of
    white noise."""
    quantum_mm: Annotated[float, Field(ge=0)] = 0.0
    """Distance of neighbouring levels of depth."""
    timings_ms: dict[str, Annotated[float, Field(ge=0)]]
    """Wall time of each stage, and `total`."""
    settings: Settings
    calibration: str
    """Which calibration was used."""
    face_score: Annotated[float, Field(ge=0, le=1)] | None = None
    """How sure it is that this is a face, by its shape, 0-1; below 0.5 nothing is given out. None
    in reports of earlier versions."""
    skew_us: int
    """Depth time stamp less colour time stamp, microseconds."""
    skew_known_by: str = ""
    """What the skew rests on: `stamps` of the sensor, `arrival` or `record order`."""
    sensor: str = ""
    """Identity of the sensor: serial number, USB port or URI."""
    captured_at: str = ""
    """When the frame was exposed, ISO 8601, UTC; empty where that is not known."""
    source: str = ""
    """What the frame was read from: `NAME.oni#0` (file and number of the frame),
    `openni2:SERIAL`."""
    exposed_after_press_ms: float | None = None
    """From the press's arrival at the sensor to the estimated exposure; None without a press."""
    exposure_known_by: str = ""
    """What that estimate rests on: `stamps` of the sensor or `arrival` at the host."""
    fused: int = 1
    """Of how many frames the depth is the average."""
    colored: bool = True
    """The sensor has a colour camera; else colours are the shades of the depth's relief."""
    registered: bool = False
    """Depth came in the colour camera's pixels."""
    depth_unit_um: int = 1000
    """Micrometres of one count of the frame's depth."""
    depth_rounding: DepthRounding = DepthRounding.ROUND
    """How a depth became a whole number of counts."""
    version: str
    warnings: Annotated[tuple[str, ...], FailFast()] = ()
    consent: Consent | None = None
    """Of the person, where the press came with one."""

    def __repr__(self) -> str:
        """Say what most readers look for; `model_dump_json` says all."""
        warned = len(self.warnings)
        return short_repr(
            self, self.capture_id, f"{self.initial_points:,} measured points",
            f"{self.dense_points:,} dense points", f"noise {self.noise_mm:.2f} mm",
            f"{self.settings.preset}", f"{warned} warning{'s' * (warned != 1)}" if warned else "",
            self.sensor or self.source, self.captured_at)

    __str__ = __repr__

    @field_validator("timings_ms")
    @classmethod
    def _known_stages(cls, given: dict[str, float]) -> dict[str, float]:
        unknown = next((name for name in given if name not in (*STAGES, "total")), None)
        if unknown is not None:
            raise ValueError(f"{unknown[:40]!r} is no stage")
        return given


@dataclass(frozen=True, eq=False, repr=False)
class Face:
    """One reconstructed face.

    Attributes
    ----------
    initial : the seeds: what was measured of the face, mm, depth camera frame
    dense : about ten points for each of them, with normals and `sigma`, in the same frame
    report : what was done to the frame, and what is odd about it
    """

    initial: PointCloud
    dense: DenseCloud
    report: Report

    def __repr__(self) -> str:
        return short_repr(
            self, self.report.capture_id, f"{len(self.initial):,} measured points",
            f"{len(self.dense):,} dense points", _sigma(self.dense),
            self.report.sensor or self.report.source, self.report.captured_at)

    def _repr_html_(self) -> str:
        report = self.report
        score = report.face_score
        took = report.timings_ms.get("total")
        return html_repr(" ".join(filter(None, ("Face", report.capture_id))), [
            ("measured points", f"{len(self.initial):,}"), ("dense points", f"{len(self.dense):,}"),
            ("extent", _extent(self.dense.points)), ("distance", _distance(self.dense.points)),
            ("sigma", _spread_of_sigma(self.dense)),
            ("noise of the depth", f"{report.noise_mm:.2f} mm"),
            ("a face by its shape", "" if score is None else f"{score:.0%}"),
            ("preset", str(report.settings.preset)), ("took", f"{took:.0f} ms" if took else ""),
            ("sensor", report.sensor), ("source", report.source), ("captured", report.captured_at),
            *(("warning", one) for one in report.warnings)], self.dense._pictures())

    def plot(self) -> "Figure":
        """Draw the face with matplotlib: its colours, its depth and `sigma`, in mm, as seen.

        Returns
        -------
        matplotlib.figure.Figure, which a notebook shows; `savefig` writes it

        Raises
        ------
        MissingPackageError
            matplotlib is not installed: the extra `notebook` brings it.
        """
        figure: Figure = _call("plot", self)
        return figure

    def to_open3d(self) -> Any:
        """Give an `open3d.geometry.TriangleMesh` of the dense points: mm, camera frame.

        Its vertices are `dense.points`, in their order, with colours and normals; triangles are
        counter-clockwise as the camera sees them. `dense.to_open3d()` gives the points alone.

        Raises
        ------
        MissingPackageError
            Open3D is not installed.
        """
        return _call("to_open3d_mesh", self)

    def to_trimesh(self) -> "Trimesh":
        """Give a `trimesh.Trimesh` of the dense points, as `to_open3d` does.

        Raises
        ------
        MissingPackageError
            trimesh is not installed: the extra `notebook` brings it.
        """
        mesh: Trimesh = _call("to_trimesh", self)
        return mesh


def _largest(pairs: Ints) -> tuple[int, int]:
    """Give the largest of (n, 2) first and second numbers, -1 of none: many pairs to a row."""
    whole = len(pairs) - len(pairs) % _PAIRS
    sums = [np.ascontiguousarray(pairs[:whole]).reshape(-1, 2 * _PAIRS), pairs[whole:]]
    first, second = np.array([-1, -1])
    for some in sums:
        if len(some):
            most = some.max(axis=0).reshape(-1, 2).max(axis=0)
            first, second = max(first, most[0]), max(second, most[1])
    return int(first), int(second)


def _extent(points: Floats) -> str:
    """Say how large a cloud is, along x, y and z."""
    if not len(points):
        return ""
    return "{:.0f} x {:.0f} x {:.0f} mm".format(*np.ptp(points, axis=0))


def _distance(points: Floats) -> str:
    return f"{np.median(points[:, 2]):.0f} mm" if len(points) else ""


def _sigma(dense: DenseCloud) -> str:
    return f"sigma {np.median(dense.sigma):.2f} mm (median)" if len(dense) else ""


def _spread_of_sigma(dense: DenseCloud) -> str:
    if not len(dense):
        return ""
    middle, most = np.percentile(dense.sigma, [50, 95])
    return f"{middle:.2f} mm (median), {most:.2f} mm (95 % are below)"


def _call(name: str, thing: object) -> Any:
    # By name: it knows the meshes of files, and is above all that is here.
    return getattr(import_module("denseface.notebook"), name)(thing)


def _check_array(name: str, given: object) -> None:
    if not isinstance(given, np.ndarray) or not given.ndim:
        raise TypeError(f"{name} must be an array, found {describe(given)}")


def _check(name: str, array: NDArray[Any], dtype: type[np.generic], shape: tuple[int, ...]) -> None:
    _check_array(name, array)
    if array.dtype != dtype or array.shape != shape:
        raise ValueError(
            f"{name} must be {np.dtype(dtype)} {shape}, found {array.dtype} {array.shape}"
        )
    if array.dtype.kind == "f":
        flat = array.ravel()
        # A finite sum of squares has finite parts, and takes half the time of isfinite.
        with np.errstate(over="ignore", invalid="ignore"):
            squares = flat @ flat
        if not (np.isfinite(squares) or np.isfinite(flat).all()):
            raise ValueError(f"{name} must be finite")
