"""Small made-up frames and calibrations."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.frame import RgbdFrame


def camera(width: int = 160, height: int = 120, f: float = 150.0, **changes: object) -> CameraModel:
    return CameraModel(**{"width": width, "height": height, "fx": f, "fy": f,
                          "cx": (width - 1) / 2, "cy": (height - 1) / 2} | changes)


def calibration(**changes: object) -> Calibration:
    return Calibration(**{"depth": camera(), "color": camera(),
                          "depth_to_color": DepthToColor(translation_mm=(25, 0, 0))} | changes)


def frame(
    depth: NDArray[np.uint16], color: NDArray[np.uint8], calib: Calibration | None = None,
    **more: Any
) -> RgbdFrame:
    return RgbdFrame(depth, color, 1000, 2000, calib or calibration(), **more)


def resampled(frame: RgbdFrame, factor: int | float) -> RgbdFrame:
    """The frame of a sensor with another resolution of both cameras."""
    known = frame.calibration
    if factor > 1:
        depth = frame.depth.repeat(int(factor), axis=0).repeat(int(factor), axis=1)
        camera = known.depth.scaled(factor)
    else:
        every = round(1 / factor)
        depth = np.ascontiguousarray(frame.depth[::every, ::every])
        camera = known.depth.scaled(factor).model_copy(update={
            "cx": known.depth.cx * factor, "cy": known.depth.cy * factor})
    color = cv2.resize(frame.rgb, None, fx=factor, fy=factor,
                       interpolation=cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
                       ).astype(np.uint8)
    calib = Calibration(depth=camera, color=known.color.scaled(factor),
                        depth_to_color=known.depth_to_color)
    return replace(frame, depth=depth, color=color, calibration=calib)


@st.composite
def cameras(draw: st.DrawFn) -> CameraModel:
    width = draw(st.integers(64, 1920))
    height = round(width * draw(st.sampled_from([3 / 4, 9 / 16, 4 / 5])))
    f = draw(st.floats(0.8, 2.0)) * width
    small = st.floats(-0.02, 0.02)
    # Wide angles magnify distortion; beyond these it may fold the image and is refused.
    mild = 0.1 * (f / width / 2) ** 2
    return CameraModel(
        width=width, height=height, fx=f, fy=f * draw(st.floats(0.95, 1.05)),
        cx=width * draw(st.floats(0.4, 0.6)), cy=height * draw(st.floats(0.4, 0.6)),
        distortion=(draw(st.floats(-mild, mild)), draw(st.floats(-mild, mild)),
                    draw(small) / 10, draw(small) / 10, draw(small) * mild))


@st.composite
def poses(draw: st.DrawFn) -> DepthToColor:
    angles = draw(st.tuples(*[st.floats(-15, 15)] * 3))
    rows = Rotation.from_euler("xyz", angles, degrees=True).as_matrix().tolist()
    return DepthToColor(rotation=rows, translation_mm=draw(st.tuples(*[st.floats(-80, 80)] * 3)))
