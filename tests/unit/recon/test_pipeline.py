"""The whole method on simulated frames."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial import cKDTree

from denseface.capture.calibration import DepthToColor
from denseface.capture.doubts import doubts_of
from denseface.capture.frame import RgbdFrame
from denseface.recon import (
    FaceWithoutDepthError,
    NoDepthError,
    NoFaceError,
    Preset,
    ReconstructionError,
    Report,
    Settings,
    TooLittleDepthError,
    reconstruct,
)
from denseface.recon.fitting import plan_fit, surface_of
from denseface.recon.noise import measure_noise
from denseface.recon.registration import register, sample_colors
from denseface.recon.segmentation import segment_face
from denseface.recon.settings import Neighbors
from denseface.recon.surface import mean_spacing
from tests.simulator import Accuracy, Light, Person, Scene, measure, simulate
from tests.simulator.heads import head_names, load_head
from tests.unit.frames import resampled

STAGES = ["overview", "detection", "registration", "segmentation", "neighbors", "rbf",
          "judgement", "propagation", "total"]


@pytest.fixture(scope="module", autouse=True)
def no_shared_folder(tmp_path_factory):
    """Let only the head be at hand that is the project's own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DENSEFACE_SHARED", str(tmp_path_factory.mktemp("shared")))
        load_head.cache_clear()
        assert head_names() == ["procedural"]
        yield


def apart(a, b):
    """Mean distance from the points of one cloud to the nearest of another, mm."""
    return float(cKDTree(b).query(a)[0].mean())


def registered(frame: RgbdFrame) -> RgbdFrame:
    """The frame as a driver gives it that registers depth to colour itself."""
    tied = register(frame)
    depth = np.full(frame.rgb.shape[:2], 65535, np.uint16)
    u, v = np.rint(tied.pixels[tied.visible]).astype(int).T
    np.minimum.at(depth, (v, u), np.rint(tied.color_depth[tied.visible]).astype(np.uint16))
    depth[depth == 65535] = 0
    return replace(frame, depth=depth, registered=True)


def shifted(frame: RgbdFrame, right: int, down: int) -> RgbdFrame:
    """The same images moved by whole pixels, and with them the cameras' axes."""
    def moved(camera):
        return camera.model_copy(update={"cx": camera.cx + right, "cy": camera.cy + down})

    known = frame.calibration
    return replace(
        frame, depth=np.roll(frame.depth, (down, right), (0, 1)),
        color=np.roll(frame.rgb, (down, right), (0, 1)), calibration=known.model_copy(
            update={"depth": moved(known.depth), "color": moved(known.color)}))


def check_sound(face) -> None:
    """What holds of every face."""
    initial, dense = face.initial, face.dense
    for array in (initial.points, dense.points, dense.normals):
        assert array.dtype == np.float32
        assert np.isfinite(array).all()
    assert initial.colors.shape == initial.points.shape
    assert dense.colors.shape == dense.points.shape
    np.testing.assert_allclose(np.linalg.norm(dense.normals, axis=1), 1, atol=1e-5)
    assert (dense.normals[:, 2] < 0).all()
    flat = dense.cells[:, 0].astype(int) * dense.grid_shape[1] + dense.cells[:, 1]
    assert (np.diff(flat) > 0).all()
    assert 8 <= len(dense) / len(initial) <= 11
    assert (face.report.initial_points, face.report.dense_points) == (len(initial), len(dense))


def check_near(found: Accuracy) -> None:
    assert found.mean_mm < found.raw_mean_mm
    assert found.lost <= 0.02
    assert found.elsewhere == 0
    assert found.gross <= 0.003


def test_a_face_is_sound_and_near_the_truth(face, shot):
    check_sound(face)
    found = measure(face, shot.truth, shot.frame)
    check_near(found)
    assert found.mean_mm < 0.7
    assert found.covered > 0.95


@pytest.mark.parametrize("preset", [Preset.PAPER, Preset.FAITHFUL])
def test_the_papers_presets(preset, shot, face):
    one = reconstruct(shot.frame, Settings(preset=preset))
    check_sound(one)
    found = measure(one, shot.truth, shot.frame)
    check_near(found)
    assert measure(face, shot.truth, shot.frame).mean_mm < found.mean_mm < 1.31
    assert one.report.settings.preset is preset
    assert one.report.r0_mm == pytest.approx(6 * one.report.mean_spacing_mm)


def test_light_has_a_fourth_of_the_points_and_is_near_the_truth(shot, face):
    one = reconstruct(shot.frame, Settings.of("light"))
    check_sound(one)
    found = measure(one, shot.truth, shot.frame)
    check_near(found)
    assert found.mean_mm < 0.75
    assert found.covered > 0.92
    assert len(one.initial) == pytest.approx(len(face.initial) / 4, rel=0.05)
    assert one.report.mean_spacing_mm == pytest.approx(2 * face.report.mean_spacing_mm, rel=0.05)
    # Two of these pixels fit into 3 mm each way, into 1.2 mm not one.
    assert len(reconstruct(shot.frame, Settings.of("light", pixel_mm=1.2)).initial) == len(
        reconstruct(shot.frame, Settings.of("light", pixel_mm=None)).initial)


def test_coarse_depth_is_refused_however_large_pixels_are(shot):
    """The mean of a square has finer steps than what was read."""
    coarse = replace(shot.frame, depth=(shot.frame.depth // 16 * 16).astype(np.uint16))
    for preset in ("best", "light"):
        with pytest.raises(ReconstructionError, match="steps of 16 mm"):
            reconstruct(coarse, Settings.of(preset))


def test_the_clouds_show_the_same_face(face):
    assert apart(face.initial.points, face.dense.points) < 1.6
    # Both are coloured as skin, brows, lips are: alike where they are near each other.
    _, nearest = cKDTree(face.dense.points[:, :2]).query(face.initial.points[:, :2])
    off = np.abs(face.dense.colors[nearest].astype(int) - face.initial.colors)
    assert np.median(off) <= 4
    assert np.quantile(off, 0.95) < 25


def test_the_report_says_what_was_done(face, shot):
    report = face.report
    x, y, w, h = report.face_box
    assert 0 < x < x + w < 640
    assert 0 < y < y + h < 480
    assert report.candidates[0].verdict == "chosen"
    assert report.candidates[0].box == report.face_box
    assert 1.0 < report.mean_spacing_mm < 1.5
    assert 8 < report.r0_mm / report.mean_spacing_mm < 25
    assert 1 < report.smoothing < 30
    assert 0.5 < report.noise_mm < 2
    assert 0.7 < report.noise_correlation_px < 3
    assert report.quantum_mm == pytest.approx(1.5, rel=0.3)
    assert list(report.timings_ms) == STAGES
    assert all(value >= 0 for value in report.timings_ms.values())
    laps = sum(value for name, value in report.timings_ms.items() if name != "total")
    assert laps <= report.timings_ms["total"]
    assert report.settings == Settings()
    assert report.calibration == "simulated sensor default"
    assert report.skew_us == shot.frame.skew_us == 11_700
    assert report.version
    assert report.warnings == ()
    written = report.model_dump_json()
    assert Report.model_validate_json(written) == report
    assert {"capture_id", "face_box", "initial_points", "dense_points", "r0_mm",
            "mean_spacing_mm", "timings_ms", "settings", "version", "warnings"} <= set(
                json.loads(written))


def test_the_same_frame_twice_is_the_same_face(face, shot):
    again = reconstruct(shot.frame)
    for cloud in ("initial", "dense"):
        for name in ("points", "colors"):
            np.testing.assert_array_equal(
                getattr(getattr(face, cloud), name), getattr(getattr(again, cloud), name))
    np.testing.assert_array_equal(face.dense.normals, again.dense.normals)
    np.testing.assert_array_equal(face.dense.sigma, again.dense.sigma)
    np.testing.assert_array_equal(face.dense.cells, again.dense.cells)
    assert again.report.candidates == face.report.candidates
    assert again.report.noise_mm == face.report.noise_mm


def test_the_frame_stays_as_it_was(shot):
    depth, color = shot.frame.depth.copy(), shot.frame.rgb.copy()
    reconstruct(shot.frame)
    np.testing.assert_array_equal(shot.frame.depth, depth)
    np.testing.assert_array_equal(shot.frame.rgb, color)


@pytest.mark.parametrize(("factor", "error_mm"), [(0.5, 1.0), (2, 0.7)])
def test_other_resolutions(shot, factor, error_mm):
    frame = resampled(shot.frame, factor)
    assert frame.depth.shape == (480 * factor, 640 * factor)
    one = reconstruct(frame)
    check_sound(one)
    found = measure(one, shot.truth, frame)
    assert found.mean_mm < error_mm
    assert found.elsewhere == 0
    assert found.lost <= 0.03
    assert one.report.mean_spacing_mm == pytest.approx(1.22 / factor, rel=0.15)


def test_depth_that_is_registered_already(shot, face):
    frame = registered(shot.frame)
    one = reconstruct(frame)
    check_sound(one)
    # Its cloud is in the frame of the camera whose pixels it has: the colour camera's.
    back = one.dense.points - np.float32(
        frame.calibration.depth_to_color.translation_mm)
    assert apart(back, face.dense.points) < 1.0
    assert shot.truth.surface_distance(back).mean() < 0.8


@pytest.mark.parametrize(("right", "down"), [(32, -24), (-45, 17)])
def test_a_moved_frame_is_the_same_face(shot, face, right, down):
    one = reconstruct(shifted(shot.frame, right, down))
    check_sound(one)
    # The cascades look at every other pixel: the box may differ by some.
    box = np.array(one.report.face_box) - (right, down, 0, 0)
    assert np.abs(box - face.report.face_box).max() <= 8
    assert len(one.initial) == pytest.approx(len(face.initial), rel=0.03)
    _, nearest = cKDTree(face.dense.points[:, :2]).query(one.dense.points[:, :2])
    off = np.abs(one.dense.points[:, 2] - face.dense.points[nearest, 2])
    assert np.median(off) < 0.2
    assert np.quantile(off, 0.95) < 1.0


def test_a_box_without_shoulders_and_wall_is_not_cut():
    """K-means taken literally would cut this face in three."""
    alone = simulate(Scene((Person(distance_mm=600, shoulders=False),), wall_mm=15_000), seed=6)[0]
    one = reconstruct(alone.frame)
    check_sound(one)
    found = measure(one, alone.truth, alone.frame)
    check_near(found)
    assert found.covered > 0.94


def test_a_close_wall_a_turned_head_and_a_lamp_from_the_side():
    hard = simulate(Scene((Person(distance_mm=750, yaw=15),), wall_mm=950,
                          light=Light((1.0, -0.2, -0.4), 0.9, 0.2)), seed=3)[0]
    one = reconstruct(hard.frame)
    check_sound(one)
    check_near(measure(one, hard.truth, hard.frame))


def test_many_holes_are_filled():
    holed = simulate(Scene((Person(distance_mm=700),), holes=1.0), seed=4)[0]
    one = reconstruct(holed.frame)
    check_sound(one)
    found = measure(one, holed.truth, holed.frame)
    check_near(found)
    assert found.covered > 0.9


@pytest.mark.parametrize("missing", [0.5, 0.8])
def test_readings_that_drop_out_at_random(face, shot, missing):
    gone = np.random.default_rng(5).random(shot.frame.depth.shape) < missing
    one = reconstruct(replace(shot.frame, depth=np.where(gone, 0, shot.frame.depth)))
    check_sound(one)
    assert shot.truth.surface_distance(one.dense.points).mean() < 0.8
    assert len(one.initial) > 0.9 * (1 - missing) * len(face.initial)
    assert one.report.warnings == ()


def test_few_seeds_are_warned_of():
    far = simulate(Scene((Person(distance_mm=1900, scale=0.88),)), seed=6)[0]
    one = reconstruct(far.frame)
    check_sound(one)
    assert len(one.initial) < 2000
    few = one.report.warnings[0]
    assert few == f"only {len(one.initial)} seeds: the face is far away or mostly unmeasured"


def test_a_calibration_in_metres_is_warned_of_whoever_made_the_frame(shot):
    metres = DepthToColor(translation_mm=(-0.025, 0, 0))
    frame = replace(shot.frame, calibration=shot.frame.calibration.model_copy(
        update={"depth_to_color": metres}))
    doubt, = doubts_of(frame.calibration)
    assert "metres in place of millimetres?" in doubt
    # Beside that colours are another place's; once is enough.
    assert reconstruct(frame).report.warnings.count(doubt) == 1
    assert reconstruct(frame.with_note(doubt)).report.warnings.count(doubt) == 1


def test_frames_far_apart_in_time_are_warned_of(shot):
    late = replace(shot.frame, depth_timestamp_us=shot.frame.color_timestamp_us - 70_000)
    report = reconstruct(late).report
    assert report.skew_us == -70_000
    assert report.warnings == ("depth and colour were taken -70.0 ms apart",)


def emptied(shot):
    return replace(shot.frame, depth=np.zeros_like(shot.frame.depth))


def faceless(shot):
    return replace(shot.frame, color=np.full_like(shot.frame.rgb, 128))


def unmeasured_face(shot):
    depth = shot.frame.depth.copy()
    depth[150:330, 220:420] = 0
    return replace(shot.frame, depth=depth)


def thin_lines(shot):
    depth = np.zeros_like(shot.frame.depth)
    depth[::6] = shot.frame.depth[::6]
    return replace(shot.frame, depth=depth)


def poster(shot):
    depth = np.full_like(shot.frame.depth, 2000)
    depth[:, :40] = 600
    return replace(shot.frame, depth=depth)


@pytest.mark.parametrize(("spoilt", "error", "message"), [
    (emptied, NoDepthError, "the depth image is empty"),
    (faceless, NoFaceError, "no face found in the colour image"),
    (unmeasured_face, FaceWithoutDepthError, "no depth was measured on it"),
    (thin_lines, TooLittleDepthError, r"\d+ depth readings on the face, a fit needs at least 50"),
    (poster, NoFaceError, "mm wide at its depth"),
])
def test_what_cannot_be_a_face_is_named(shot, spoilt, error, message):
    with pytest.raises(error, match=message) as caught:
        reconstruct(spoilt(shot))
    assert isinstance(caught.value, ReconstructionError)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seed", range(3))
def test_depth_without_sense_is_a_named_error_or_a_sound_face(shot, seed):
    rng = np.random.default_rng(seed)
    low, high = ((0, 65536), (600, 800), (690, 720))[seed]
    depth = rng.integers(low, high, shot.frame.depth.shape).astype(np.uint16)
    try:
        one = reconstruct(replace(shot.frame, depth=depth))
    except ReconstructionError:
        return
    check_sound(one)


@pytest.mark.parametrize("size", [(320, 240), (1280, 960)])
def test_frames_of_half_and_twice_the_size(face, shot, size):
    def resized(image):
        rows, columns = (np.arange(new) * old // new
                         for new, old in zip(size[::-1], image.shape, strict=False))
        return np.ascontiguousarray(image[np.ix_(rows, columns)])

    known, factor = shot.frame.calibration, size[0] / 640
    one = reconstruct(replace(
        shot.frame, depth=resized(shot.frame.depth), color=resized(shot.frame.rgb),
        calibration=known.model_copy(update={
            "depth": known.depth.scaled(factor), "color": known.color.scaled(factor)})))
    check_sound(one)
    assert len(one.initial) == pytest.approx(factor**2 * len(face.initial), rel=0.03)
    errors = shot.truth.surface_distance(one.dense.points)
    assert errors.mean() < 0.75
    assert (errors > 5.5).mean() < 0.001


def test_a_sharper_colour_camera_leaves_the_same_seeds(face, shot):
    """What is measured in depth pixels must not be counted in the colour camera's."""
    known = shot.frame.calibration
    color = shot.frame.rgb.repeat(2, axis=0).repeat(2, axis=1)
    sharp = reconstruct(replace(
        shot.frame, color=color,
        calibration=known.model_copy(update={"color": known.color.scaled(2)})))
    assert len(sharp.initial) == pytest.approx(len(face.initial), rel=0.005)
    assert apart(face.initial.points, sharp.initial.points) < 0.3


@pytest.mark.parametrize("light", [Light(), Light((1.0, -0.2, -0.45), 0.9, 0.18),
                                   Light((0.0, -1.0, -0.6))])
def test_shading_brings_a_face_nearer_to_the_truth(light):
    shot, = simulate(Scene((Person(distance_mm=760, yaw=8),), light=light), seed=4)
    without, with_it = (
        measure(reconstruct(shot.frame, Settings(shading=shading)), shot.truth, shot.frame)
        for shading in (False, True))
    assert with_it.mean_mm < 0.99 * without.mean_mm
    assert with_it.gross <= without.gross + 1e-4


def test_without_colour_the_face_is_that_of_depth(shot):
    """What is there to see is one grey, so that nothing but its border can be told from it."""
    box = reconstruct(shot.frame).report.face_box
    grey = replace(shot.frame, color=np.full_like(shot.frame.rgb, 128))
    heights = []
    for frame, shading in ((grey, True), (shot.frame, False)):
        tied = register(frame)
        seeds = segment_face(tied, box, frame.calibration.color.fx)
        spacing = mean_spacing(seeds.points, seeds.pixels, Neighbors.LATTICE)
        how = Settings(shading=shading)
        plan = plan_fit(how, measure_noise(seeds.points, seeds.pixels, spacing), spacing)
        surface = surface_of(seeds.points, spacing, how, plan,
                             partial(sample_colors, frame, tied))
        heights.append(surface.values[0])
    assert np.abs(heights[0] - heights[1]).mean() < 0.02
