"""Kinds of depth sensor, with cameras and noise of their own.

`SENSORS` holds what settings are chosen and claims are tested on. No figure is that of one product:
each row is a kind, drawn within what data sheets and papers report of it.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.frame import DepthMeaning, DepthRounding
from tests.simulator.depth_noise import KINECT_V1, DepthNoise, Edges, Levels
from tests.simulator.kinect import KINECT_CALIBRATED, KinectModel

__all__ = ["SENSORS"]

_WHITE, _ALIKE_1, _ALIKE_2, _ALIKE_4 = ((1.0, 0.0),), ((1.0, 1.0),), ((1.0, 2.0),), ((1.0, 4.0),)
_ROUNDED = DepthMeaning(rounding=DepthRounding.ROUND)
_FINE = DepthMeaning(unit_um=100, rounding=DepthRounding.ROUND)

_PRIMESENSE = replace(
    KINECT_V1, axial=(0.75, 1.6, 0.65), spectrum=_ALIKE_1, jitter_px=0.35,
    jitter_correlation_px=1.0, edge_px=0.8, steady_share=0.5)
"""Structured light, its noise alike over one pixel."""
_TIME_OF_FLIGHT = DepthNoise(
    axial=(1.4, 0.8, 0.7), spectrum=_WHITE, steady_share=0.1, jitter_px=0.15,
    jitter_correlation_px=1.0, edges=Edges.MIXED, levels=Levels.ANY, meaning=_ROUNDED,
    shadows=False, grazing=(0.04, 0.12))
"""Each pixel on its own, so white; pixels at edges mix both sides. Like the narrow unbinned mode of
current cameras: 640 x 576, 75 degrees."""
_STEREO = DepthNoise(
    axial=(1.5, 4.0, 0.6), spectrum=((0.4, 2.5), (0.6, 5.0)), steady_share=0.5, jitter_px=0.8,
    jitter_correlation_px=3.0, edge_px=2.5, edge_correlation_px=4.0, edge_reach_px=6,
    levels=Levels.DISPARITY, disparity_step=1 / (32 * 430.0 * 50.0), meaning=_FINE)
"""Active stereo, 50 mm apart, disparities in 1/32 pixel, matched by broad windows."""


def _camera(width: int, height: int, focal_px: float) -> CameraModel:
    return CameraModel(width=width, height=height, fx=focal_px, fy=focal_px,
                       cx=(width - 1) / 2 + 3.2, cy=(height - 1) / 2 - 2.7)


def _beside(depth: CameraModel, color: CameraModel, x_mm: float) -> Calibration:
    return Calibration(depth=depth, color=color,
                       depth_to_color=DepthToColor(translation_mm=(x_mm, 0.0, 0.0)))


_VGA = _beside(_camera(640, 480, 575.8), _camera(640, 480, 530.0), -25.0)
_TOF_CAMERAS = _beside(_camera(640, 576, 504.0), _camera(1280, 720, 605.0), -32.0)
_STEREO_CAMERAS = _beside(_camera(640, 480, 430.0), _camera(640, 480, 610.0), 15.0)


def _structured_light(name: str, noise: DepthNoise) -> KinectModel:
    return KinectModel(name, _VGA, (75.0, 0.0, 0.0), noise)


def _louder(noise: DepthNoise, times: float) -> DepthNoise:
    a, b, c = noise.axial
    return replace(noise, axial=(a * times, b * times, c))


SENSORS: Mapping[str, KinectModel] = MappingProxyType({one.name: one for one in (
    replace(KINECT_CALIBRATED, name="kinect v1"),
    _structured_light("kinect v1, half the noise", _louder(KINECT_V1, 0.5)),
    _structured_light("kinect v1, twice the noise", _louder(KINECT_V1, 2.0)),
    _structured_light("structured light, white", replace(_PRIMESENSE, spectrum=_WHITE)),
    _structured_light("structured light, alike over 1 px", _PRIMESENSE),
    _structured_light("structured light, alike over 2 px", replace(_PRIMESENSE, spectrum=_ALIKE_2)),
    _structured_light("structured light, alike over 4 px", replace(_PRIMESENSE, spectrum=_ALIKE_4)),
    _structured_light("xtion, quiet", replace(
        _PRIMESENSE, axial=(0.35, 0.9, 0.65), jitter_px=0.25)),
    _structured_light("rounded, alike over 1 px", replace(
        _PRIMESENSE, levels=Levels.ANY, meaning=_ROUNDED)),
    _structured_light("fine levels, alike over 2 px", replace(
        _PRIMESENSE, spectrum=_ALIKE_2, levels=Levels.ANY, meaning=_FINE)),
    KinectModel("time of flight", _TOF_CAMERAS, (0.0, 0.0, 0.0), _TIME_OF_FLIGHT),
    KinectModel("active stereo", _STEREO_CAMERAS, (50.0, 0.0, 0.0), _STEREO),
)})
"""By name."""
