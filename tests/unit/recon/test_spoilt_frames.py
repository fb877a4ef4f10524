"""Whatever a frame holds, a face comes out or an error that has a name."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from denseface.capture.calibration import CameraModel, DepthToColor
from denseface.capture.frame import RgbdFrame
from denseface.recon import ReconstructionError, Settings, reconstruct
from tests.unit.frames import resampled

DEEPEST = 65535
Spoil = Callable[[RgbdFrame], RgbdFrame]


def outcome(frame: RgbdFrame, how: Settings | None = None) -> str:
    """Reconstruct; name what came of it, or fail by an error that is none of ours."""
    try:
        face = reconstruct(frame, how)
    except ReconstructionError as error:
        if len(str(error).splitlines()) != 1:
            pytest.fail(f"not one clear line: {error!r}")
        return type(error).__name__
    for array in (face.initial.points, face.dense.points, face.dense.normals):
        assert np.isfinite(array).all()
    assert len(face.dense) > 0
    return "Face"


@st.composite
def regions(draw: st.DrawFn) -> tuple[slice, slice]:
    """A rectangle of a 320x240 image: often the face's middle, one pixel, a line, or all of it."""
    top, left = draw(st.integers(0, 239)), draw(st.integers(0, 319))
    height = draw(st.sampled_from([1, 1, 7, 40, 120, 240]))
    width = draw(st.sampled_from([1, 1, 7, 40, 160, 320]))
    if draw(st.booleans()):
        top, left = max(120 - height // 2, 0), max(160 - width // 2, 0)
    step = draw(st.sampled_from([1, 1, 2, 3]))
    return slice(top, top + height, step), slice(left, left + width, step)


@st.composite
def spoils(draw: st.DrawFn) -> Spoil:
    """One change to a frame: depth set, added to, made noise, or moved; colour painted over."""
    kind = draw(st.sampled_from(["set", "add", "noise", "move", "paint", "flip", "alternate"]))
    where = draw(regions())
    value = draw(st.sampled_from([0, 1, 2, 399, 700, 2000, 10_000, 32_767, DEEPEST - 1, DEEPEST]))
    seed = draw(st.integers(0, 99))

    def changed(frame: RgbdFrame) -> RgbdFrame:
        depth, color = frame.depth.copy(), frame.rgb.copy()
        rng = np.random.default_rng(seed)
        if kind == "set":
            depth[where] = value
        elif kind == "add":
            depth[where] += np.uint16(value)  # wraps around
        elif kind == "noise":
            depth[where] = rng.integers(0, value + 1, depth[where].shape)
        elif kind == "move":
            depth = np.roll(depth, (seed - 50, value % 320), (0, 1))
        elif kind == "paint":
            color[where] = rng.integers(0, 256, (*color[where].shape[:2], 3))
        elif kind == "flip":
            depth = np.ascontiguousarray(depth[::-1, ::-1])
        else:
            depth[::2, 1::2] = depth[1::2, ::2] = value
        return replace(frame, depth=depth, color=color)

    return changed


@pytest.fixture(scope="module")
def small(shot):
    """The simulated face at 320x240, quick to reconstruct."""
    return resampled(shot.frame, 0.5)


def test_the_small_frame_is_a_face(small):
    assert small.depth.shape == (240, 320)
    assert outcome(small) == "Face"


@settings(deadline=None, max_examples=60,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(spoils(), min_size=1, max_size=4))
def test_pieces_out_of_place(small, changes):
    frame = small
    for change in changes:
        frame = change(frame)
    outcome(frame)


@pytest.mark.parametrize("preset", ["paper", "faithful", "best"])
@pytest.mark.parametrize("value", [0, 1, 700, DEEPEST])
def test_the_same_depth_everywhere(small, value, preset):
    frame = replace(small, depth=np.full_like(small.depth, value))
    found = outcome(frame, Settings.of(preset))
    # At 700 mm it is the size of a face, but flat: a photograph.
    # At 1 mm nothing is seen, and whether a box looks like a face in so small a picture is chance.
    assert found in {0: {"NoDepthError"}, 1: {"FaceWithoutDepthError", "NoFaceError"}}.get(
        value, {"NoFaceError"})


@pytest.mark.parametrize("value", [0, 1, DEEPEST])
def test_every_other_reading_out_of_this_world(small, value):
    v, u = np.indices(small.depth.shape)
    frame = replace(small, depth=np.where((u + v) % 2, small.depth, value).astype(np.uint16))
    # With none of the pixels read that are looked at first, the others still make a face.
    assert outcome(frame) in ({"Face"} if value == 0 else {
        "Face", "NoFaceError", "FaceWithoutDepthError", "TooLittleDepthError"})


@pytest.mark.parametrize("place", [(0, 0), (120, 160), (239, 319)])
@pytest.mark.parametrize("value", [1, 700, DEEPEST])
def test_one_reading(small, place, value):
    depth = np.zeros_like(small.depth)
    depth[place] = value
    assert outcome(replace(small, depth=depth)) in {
        "NoDepthError", "NoFaceError", "FaceWithoutDepthError", "TooLittleDepthError"}


@settings(deadline=None, max_examples=40,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_calibration_that_is_accepted(small, data):
    """Both cameras anywhere, looking anywhere, at any focal length."""
    def camera(known: CameraModel) -> CameraModel:
        f = data.draw(st.sampled_from([3.2, 30.0, known.fx, 1e4, 3.2e5]))
        center = data.draw(st.sampled_from([-3.2e5, 0.0, known.cx, 3.2e5]))
        return CameraModel(width=known.width, height=known.height, fx=f, fy=f, cx=center,
                           cy=known.cy)

    known = small.calibration
    turn = data.draw(st.sampled_from([(1, 1, 1), (1, -1, -1), (-1, -1, 1)]))
    pose = DepthToColor(
        rotation=tuple(tuple(row) for row in np.diag(np.array(turn, float)).tolist()),
        translation_mm=tuple(data.draw(st.sampled_from([0.0, -25.0, 700.0, -1e4]))
                             for _ in range(3)))
    calibration = known.model_copy(update={
        "depth": camera(known.depth), "color": camera(known.color), "depth_to_color": pose})
    outcome(small.with_calibration(calibration, "made up"))


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 700), (700, 1), (4096, 5)])
def test_colour_images_that_are_strips(small, width, height):
    known = small.calibration.color
    camera = known.model_copy(update={"width": width, "height": height})
    frame = replace(small, color=np.zeros((height, width, 3), np.uint8),
                    calibration=small.calibration.model_copy(update={"color": camera}))
    assert outcome(frame) in {"NoFaceError", "FaceWithoutDepthError", "NoDepthError"}


@pytest.mark.parametrize("translation", [(-1e9, 0.0, 1e300), (-1e300, 0.0, 0.0)])
@pytest.mark.parametrize("focal_px", [300.0, 1e300])
def test_depths_beyond_all_numbers_are_no_depth(small, translation, focal_px):
    known = small.calibration
    calibration = known.model_copy(update={
        "color": known.color.model_copy(update={"fx": focal_px, "fy": focal_px}),
        "depth_to_color": known.depth_to_color.model_copy(
            update={"translation_mm": translation})})
    with np.errstate(all="ignore"):
        assert outcome(small.with_calibration(calibration, "made up")) in {
            "NoDepthError", "NoFaceError", "FaceWithoutDepthError"}


@settings(deadline=None, max_examples=8,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 999), share=st.floats(0.05, 1 / 3))
def test_holes_up_to_a_third_of_the_face(shot, face, seed, share):
    rng = np.random.default_rng(seed)
    rows, columns = np.rint(
        shot.frame.depth_camera.project(face.initial.points)[:, ::-1]).astype(int).T
    gone = np.zeros(shot.frame.depth.shape, np.uint8)
    while gone[rows, columns].mean() < share:
        middle = rng.integers(0, len(rows))
        cv2.circle(gone, (int(columns[middle]), int(rows[middle])), int(rng.integers(2, 14)), 1, -1)
    frame = replace(shot.frame, depth=np.where(gone, 0, shot.frame.depth).astype(np.uint16))
    one = reconstruct(frame)
    assert len(one.initial) > 0.4 * len(face.initial)  # what holes cut off may be lost too
    errors = shot.truth.surface_distance(one.dense.points)
    assert errors.mean() < 1.0
    assert (errors > 10).mean() < 0.01
