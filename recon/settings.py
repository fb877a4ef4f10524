"""The settings of the reconstruction, and the presets that choose them."""

from enum import StrEnum
from typing import Annotated, Any, Self, TypedDict, Unpack

from pydantic import BeforeValidator, Field, model_validator

from denseface.checked_model import CheckedModel
from denseface.recon.errors import ImpossibleSettingsError

__all__ = ["Changes", "Neighbors", "Preset", "Settings"]


_FORMER = frozenset({"depth_offset_mm"})
"""Settings that reports of older faces still name; how a depth was rounded is the frame's now."""


class Neighbors(StrEnum):
    """How the neighbourhood of a seed is found."""

    RANDOMIZED = "randomized"
    """Randomized kd-trees, as in the paper; approximate, differs between runs."""
    EXACT = "exact"
    """One exact kd-tree."""
    LATTICE = "lattice"
    """The depth image's own pixels: exact where the seeds come from one image."""


class Preset(StrEnum):
    """A named choice of all settings, one row each; a setting given beside it wins."""

    settings: dict[str, Any]
    """What differs from the defaults of `Settings`."""

    def __new__(cls, name: str, settings: dict[str, Any] | None = None) -> Self:
        """Attach the settings to the name."""
        preset = str.__new__(cls, name)
        preset._value_ = name
        preset.settings = settings or {}
        return preset

    PAPER = "paper", {"r0_factor": 6.0, "smoothing": 0.1, "neighbors": Neighbors.RANDOMIZED}
    """The paper's R0 and the little smoothing that meets its reported error."""
    FAITHFUL = "faithful", {"r0_factor": 6.0, "smoothing": 3.0, "neighbors": Neighbors.RANDOMIZED}
    """The paper's R0 with the smoothing that a sensor's noise asks for."""
    LIGHT = "light", {"pixel_mm": 3.0, "r0_factor": None, "smoothing": None, "detail_factor": 0.7,
                      "symmetry": True, "shading": True, "neighbors": Neighbors.LATTICE}
    """For small computers: a fourth of the points in half the time, from larger pixels."""
    BEST = "best", {"r0_factor": None, "smoothing": None, "detail_factor": 1.0, "symmetry": True,
                    "shading": True, "prior": True, "neighbors": Neighbors.LATTICE}
    """The most accurate found: R0 and lambda follow from the noise measured in the frame."""


class Changes(TypedDict, total=False):
    """What `Settings.of` may change: the fields of `Settings`, as type checkers see them."""

    r0_factor: float | None
    smoothing: float | None
    detail_factor: float | None
    symmetry: bool
    shading: bool
    prior: bool
    neighbors: Neighbors | str
    pixel_mm: float | None
    ratio: float


def _none_by_its_name(given: object) -> object:
    return None if given == "none" else given


def _measured_by_its_name(given: object) -> object:
    return None if given == "measured" else given


class Settings(CheckedModel):
    """Settings of `reconstruct`; what is not given comes from the preset."""

    error = ImpossibleSettingsError

    preset: Preset = Preset.BEST
    r0_factor: Annotated[
        Annotated[float, Field(ge=2, le=40)] | None, BeforeValidator(_measured_by_its_name)] = None
    """R0 of Eq. (3) in units of the seeds' mean spacing; None (`measured`): as the frame's noise
    asks for."""
    smoothing: Annotated[
        Annotated[float, Field(ge=0.05, le=1000)] | None,
        BeforeValidator(_measured_by_its_name)] = None
    """lambda: weight of the squared norm against the squared residuals (unitless); None
    (`measured`): as the frame's noise asks for."""
    detail_factor: Annotated[
        Annotated[float, Field(ge=0.5, le=10)] | None, BeforeValidator(_none_by_its_name)] = None
    """Radius of the averages that give back what the fit smooths away, in mean spacings; None:
    the fit alone."""
    symmetry: bool = False
    """Let each side of the face be helped by the mirror image of the other; only where detail is
    added (`detail_factor`)."""
    shading: bool = False
    """Let the colour image's shading tell slopes that depth's noise hides; only where detail is
    added (`detail_factor`)."""
    prior: bool = False
    """Let the face go on a few millimetres past its outline, where the sensor read nothing and a
    model of faces says that it does."""
    neighbors: Neighbors = Neighbors.LATTICE
    """How the mean spacing is measured."""
    pixel_mm: Annotated[
        Annotated[float, Field(ge=0.5, le=6)] | None, BeforeValidator(_none_by_its_name)] = None
    """Pixels of the depth that are smaller than this on the face are averaged in squares, as large
    as it allows, mm; None: each counts by itself."""
    ratio: Annotated[float, Field(ge=1, le=100)] = 10.0
    """Dense points for each seed."""

    @model_validator(mode="before")
    @classmethod
    def _from_preset(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        try:
            preset = Preset(given.get("preset", Preset.BEST))
        except ValueError:
            return given  # the field's own validation says what is wrong
        return preset.settings | {k: v for k, v in given.items() if k not in _FORMER}

    @classmethod
    def of(cls, preset: Preset | str = Preset.BEST, **changes: Unpack[Changes]) -> Self:
        """Give a preset with some settings changed.

        Raises
        ------
        ImpossibleSettingsError
            One line that names the setting: it is unknown, or its value is out of its range.
        """
        return cls(**{**changes, "preset": preset})
