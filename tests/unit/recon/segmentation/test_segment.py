"""Stage 3 on shapes that say by themselves what belongs to the face."""

import cv2
import numpy as np
import pytest

from denseface.recon.errors import FaceWithoutDepthError
from denseface.recon.segmentation._segment import (
    cluster_depths,
    crop_to_box,
    grow_face,
    segment_face,
)
from tests.unit.recon.shapes import FOCAL, NEAR, box, ellipsoid, grid, registration

HEAD = ellipsoid()
ON_HEAD = np.isfinite(HEAD)
BOX = box()
CLUSTERS = 3
# Of an ellipsoid, the flanks are too steep to be measured or joined: the front is the face.
FACE = HEAD < NEAR + 60


def kept(registered, frame_box=BOX):
    pixels = segment_face(registered, frame_box, FOCAL).pixels
    mask = np.zeros(registered.valid.shape, bool)
    mask[tuple(pixels.T)] = True
    return mask


def literal_clusters(z):
    """The paper's k-means as it stands, by Lloyd's rounds from the quantiles."""
    centers = np.quantile(z, (np.arange(CLUSTERS) + 0.5) / CLUSTERS)
    for _ in range(50):
        labels = np.abs(z[:, None] - centers).argmin(axis=1)
        centers = np.array([z[labels == k].mean() for k in range(CLUSTERS)])
    return labels


def test_a_face_that_fills_its_box_is_not_cut_into_three():
    registered = registration(HEAD)
    crop = crop_to_box(registered, BOX)
    z = registered.points[..., 2][crop]
    # Taken literally, the cluster of the nose is less than half of the face.
    nearest = np.bincount(literal_clusters(z))[0]
    assert nearest < 0.6 * len(z)
    assert (cluster_depths(registered, crop, BOX) == crop).all()
    assert kept(registered)[FACE].mean() > 0.995


@pytest.mark.parametrize("behind_mm", [200, 400, 2000])
def test_a_wall_behind_is_dropped(behind_mm):
    registered = registration(np.minimum(HEAD, NEAR + behind_mm))
    crop = crop_to_box(registered, BOX)
    assert (crop & ~ON_HEAD).sum() > 300
    assert not cluster_depths(registered, crop, BOX)[~ON_HEAD].any()
    face = kept(registered)
    assert not face[~ON_HEAD].any()
    assert face[FACE].mean() > 0.995


def test_a_second_person_behind_is_dropped():
    other = ellipsoid(x=110, y=20, front=NEAR + 250)
    registered = registration(np.minimum(HEAD, other))
    assert (crop_to_box(registered, BOX) & ~ON_HEAD).sum() > 50
    face = kept(registered)
    assert not face[~ON_HEAD].any()
    assert face[FACE].mean() > 0.995


def test_the_person_behind_is_cut_out_as_well_when_asked_for():
    other = ellipsoid(x=110, y=20, front=NEAR + 250)
    registered = registration(np.minimum(HEAD, other))
    face = kept(registered, box(110, 20, NEAR + 250))
    assert face.sum() > 500
    assert not face[ON_HEAD].any()


def two_halves(right_mm, gap_px=0):
    """A plane whose right half stands elsewhere, the halves parted by unmeasured columns."""
    depth = np.full(HEAD.shape, NEAR)
    middle = round(BOX[0] + BOX[2] / 2) + 12
    depth[:, middle:] += right_mm
    depth[:, middle:middle + gap_px] = np.inf
    return registration(depth), np.arange(HEAD.shape[1]) >= middle


@pytest.mark.parametrize(("step_mm", "crosses"), [(0, True), (8, True), (-8, True),
                                                  (24, False), (-24, False), (40, False)])
def test_the_flood_stops_at_a_step(step_mm, crosses):
    registered, right = two_halves(step_mm)
    crop = crop_to_box(registered, BOX)
    assert cluster_depths(registered, crop, BOX)[:, right].any()
    face = grow_face(registered, crop, BOX, FOCAL)
    assert face[:, ~right].any()
    assert face[:, right].any() == crosses


@pytest.mark.parametrize(("gap_px", "crosses"), [(1, True), (3, True), (4, True), (9, False)])
def test_the_flood_bridges_narrow_gaps_only(gap_px, crosses):
    registered, right = two_halves(0, gap_px)
    face = grow_face(registered, crop_to_box(registered, BOX), BOX, FOCAL)
    assert face[:, ~right].any()
    assert face[:, right].any() == crosses


def test_a_hole_in_the_face_costs_only_itself():
    holed = HEAD.copy()
    hole = np.hypot(*(np.stack(grid()) * NEAR - [[[20]], [[-30]]])) < 12
    holed[hole] = np.inf
    face = kept(registration(holed))
    assert not face[hole].any()
    assert face[FACE & ~hole].mean() > 0.995


def test_neck_and_chest_behind_the_chin_are_cut():
    _, y = grid()
    down = y * NEAR
    # The chin slopes off gently enough for the flood to reach neck and chest.
    body = NEAR + 20 + np.interp(down, [70, 130], [0, 90])
    depth = np.minimum(HEAD, np.where(down > 60, body, np.inf))
    face = kept(registration(depth))
    assert not face[(down > 125)].any()
    assert not face[depth > NEAR + 95].any()
    assert face[FACE & (down < 85)].mean() > 0.99


def test_a_frame_of_glasses_goes_to_where_it_hardly_stands_out():
    x, y = (axis * NEAR for axis in grid())
    bar = (np.abs(y) < 2.5) & (np.abs(x) < 25)
    lid = (np.abs(y - 20) < 2.5) & (np.abs(x) < 10)
    worn = HEAD - np.where(bar, np.where(x < 0, 9, 5), 0) - np.where(lid, 5, 0)
    face = kept(registration(worn))
    assert not face[bar & (x < 0)].any()
    assert face[bar & (x > 2)].mean() < 0.1
    assert face[lid].all()
    faint = HEAD - np.where(bar | lid, 5, 0)
    assert kept(registration(faint))[bar | lid].all()


@pytest.mark.parametrize("half_width", [3, 9])
def test_spurs_are_removed(half_width):
    x, y = (axis * NEAR for axis in grid())
    disc = np.hypot(x, y) < 60
    tongue = (np.abs(y) < half_width) & (x > 0) & (x < 95)
    registered = registration(np.where(disc | tongue, NEAR, np.inf))
    assert crop_to_box(registered, BOX)[tongue & (x > 75)].sum() > 15
    face = kept(registered)
    assert not face[x > 70].any()
    assert face[disc].mean() > 0.99


def test_an_island_that_hangs_on_by_a_thread_is_removed():
    x, y = (axis * NEAR for axis in grid())
    disc = np.hypot(x, y) < 50
    ear = np.hypot(x - 75, y) < 18
    registered = registration(np.where(disc | ear | (np.abs(y) < 5) & (x > 0) & (x < 75),
                                       NEAR, np.inf))
    assert crop_to_box(registered, BOX)[ear].mean() > 0.95
    face = kept(registered)
    assert not face[ear].any()
    assert face[disc].mean() > 0.99


def test_colours_along_the_outline_come_from_inside():
    color = np.zeros((*HEAD.shape, 3), np.uint8)
    color[ON_HEAD] = (200, 60, 40)
    color[~ON_HEAD] = (0, 0, 255)
    # As a lens does: at the outline the wall behind mixes in.
    color = cv2.GaussianBlur(color, (5, 5), 0)
    registered = registration(np.minimum(HEAD, NEAR + 500), color)
    seeds = segment_face(registered, BOX, FOCAL)
    mixed = np.abs(registered.colors[tuple(seeds.pixels.T)].astype(int) - (200, 60, 40)).max(axis=1)
    assert (mixed > 20).sum() > 5
    assert np.abs(seeds.colors.astype(int) - (200, 60, 40)).max() <= 2


def test_colours_around_a_hole_inside_are_kept():
    away = np.hypot(*(np.stack(grid()) * NEAR))
    color = np.full((*HEAD.shape, 3), (200, 150, 120), np.uint8)
    color[away < 20] = (60, 40, 30)  # an eye, of which the middle is not measured
    registered = registration(np.where(away < 12, np.inf, HEAD), color)
    seeds = segment_face(registered, BOX, FOCAL)
    around = away[tuple(seeds.pixels.T)] < 17
    assert around.sum() > 20
    assert (seeds.colors[around] == (60, 40, 30)).all()


def test_a_point_that_the_colour_camera_does_not_see_is_coloured_by_its_neighbours():
    nose = ellipsoid(front=NEAR - 40, axes=(25, 35, 70))
    color = np.full((*HEAD.shape, 3), (180, 120, 100), np.uint8)
    registered = registration(np.minimum(HEAD, nose), color, baseline_mm=60)
    u = BOX[0]
    moved = (u + round(60 * FOCAL / NEAR), *BOX[1:])
    seeds = segment_face(registered, moved, FOCAL)
    unseen = ~registered.visible[tuple(seeds.pixels.T)]
    assert unseen.sum() > 20
    assert (seeds.colors == (180, 120, 100)).all()


def test_seeds_are_the_readings_in_order():
    registered = registration(np.minimum(HEAD, NEAR + 400))
    seeds = segment_face(registered, BOX, FOCAL)
    assert seeds.pixels.dtype == np.int32
    assert seeds.points.dtype == np.float32
    assert seeds.colors.dtype == np.uint8
    flat = seeds.pixels[:, 0] * HEAD.shape[1] + seeds.pixels[:, 1]
    assert (np.diff(flat) > 0).all()
    np.testing.assert_array_equal(seeds.points, registered.points[tuple(seeds.pixels.T)])


@pytest.mark.parametrize("depth", [np.full(HEAD.shape, NEAR), HEAD])
def test_the_same_frame_gives_the_same_seeds(depth):
    registered = registration(depth)
    np.testing.assert_array_equal(kept(registered), kept(registered))


def test_a_flat_wall_is_one_cluster():
    registered = registration(np.full(HEAD.shape, 1000.0))
    crop = crop_to_box(registered, BOX)
    assert (cluster_depths(registered, crop, BOX) == crop).all()


def test_fewer_readings_than_clusters_are_kept():
    depth = np.full(HEAD.shape, np.inf)
    row, column = BOX[1] + BOX[3] // 2, BOX[0] + BOX[2] // 2
    depth[row, column:column + 2] = NEAR
    registered = registration(depth)
    crop = crop_to_box(registered, BOX)
    assert crop.sum() == 2
    assert (cluster_depths(registered, crop, BOX) == crop).all()


def test_no_depth_in_the_box_is_named():
    registered = registration(HEAD)
    with pytest.raises(FaceWithoutDepthError, match="no depth was measured in the face's box"):
        segment_face(registered, (2, 2, 30, 30), FOCAL)


def test_depth_that_the_colour_camera_does_not_see_is_no_face():
    # The box reaches past the image's edge, and all depth in it lies out there.
    registered = registration(HEAD, baseline_mm=-500)
    assert not registered.visible[ON_HEAD].any()
    with pytest.raises(FaceWithoutDepthError, match="sees"):
        segment_face(registered, (round(BOX[0] - 500 * FOCAL / NEAR), *BOX[1:]), FOCAL)
