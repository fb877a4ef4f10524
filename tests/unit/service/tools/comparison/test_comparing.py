"""What changed in a face, and that nothing is said where nothing did."""

import json
from html.parser import HTMLParser

import cv2
import numpy as np
import open3d as o3d
import pytest

from denseface.service.errors import ServiceError
from denseface.service.tools.comparison.alignment import align
from denseface.service.tools.comparison.comparing import LaidOn, compare_surfaces
from denseface.service.tools.comparison.differences import distances, sites_of
from denseface.service.tools.comparison.regions import HeadPlace, region_name, rigidity
from denseface.service.tools.comparison.smoothing import Blur, null_fields
from denseface.service.tools.comparison.surface import Pose, Surface
from denseface.service.tools.comparison.told import Told
from tests.unit.service.tools.comparison.made_faces import CHEEK, made_face, pose

POSES = [pose(*turn, shift=(10 * x, -8 * x, 690 + 12 * x)) for x, turn in enumerate(
    [(0, 0, 0), (4, -2, 1), (-5, 3, -2), (3, 3, 2), (-2, -3, 0), (6, 1, -1)])]
BEFORE, REPEAT, RAISED = range(3), range(3, 6), range(6, 9)


@pytest.fixture(scope="module")
def surfaces():
    heights = [0.0] * 6 + [0.5] * 3
    return [Surface.of_face(made_face(seed, POSES[seed % 6], height=height))
            for seed, height in enumerate(heights)]


@pytest.fixture(scope="module")
def laid(surfaces):
    return LaidOn.of(surfaces, [str(number) for number in range(len(surfaces))],
                     apart_mm=4.5)


@pytest.fixture(scope="module")
def repeats(laid):
    return [laid.compare(*sides) for sides in ((BEFORE, REPEAT), ([0], [4]), ([1, 5], [2, 3]))]


@pytest.fixture(scope="module")
def raised(laid):
    return laid.compare(BEFORE, RAISED)


def cheek():
    """Where the change is, in the first face's frame: (x, y)."""
    return CHEEK + POSES[0][1][:2]


def test_a_raised_cheek_is_found_with_its_place_size_and_sign(raised):
    change = raised.verdict.changes[0]
    assert len(raised.verdict.changes) == 1
    assert "left cheek" in raised.names[change.peak]
    assert np.hypot(*(raised.sites.points[change.peak, :2] - cheek())) < 6
    assert 0.25 < change.mean_mm < 0.55
    assert 0.01 < change.half_mm < 0.15
    assert 12 < change.width_mm < 34


def test_the_other_way_round_it_has_the_other_sign(laid):
    changes = laid.compare(RAISED, BEFORE).verdict.changes
    assert len(changes) == 1
    assert -0.55 < changes[0].mean_mm < -0.25


def test_repeats_without_change_report_none(repeats):
    for result in repeats:
        assert not result.verdict.changes
        assert np.nanmax(np.abs(result.verdict.score)) < 1
        assert abs(result.numbers.mean_mm) < 0.03


def test_what_would_be_found_shrinks_with_the_captures(repeats):
    three, one, _ = repeats
    assert three.verdict.finds_mm < 0.75 * one.verdict.finds_mm
    assert three.verdict.finds_mm < 0.5
    assert 0.04 < three.verdict.noise_mm < 0.2
    assert 2.5 <= three.verdict.length_mm < 7


def test_more_confidence_asks_for_more(laid, raised):
    sure = laid.compare(BEFORE, RAISED, confidence=0.98)
    assert sure.verdict.changes[0].score < raised.verdict.changes[0].score
    assert sure.verdict.changes[0].half_mm > raised.verdict.changes[0].half_mm


def test_the_threshold_holds_for_fresh_noise():
    side = np.arange(0, 60, 3.0)
    points = np.stack([*np.meshgrid(side, side), np.zeros((20, 20))], axis=-1).reshape(-1, 3)
    known = points[:, 0] < 54
    blurs = [Blur(points, 5.0), Blur(points, 8.0)]
    null = null_fields(points, known, 4.0, blurs)
    fresh = Blur(points, 4.0).noise(np.random.default_rng(99).standard_normal((400, 2000)))
    fresh[~known] = 0
    largest = np.max([np.abs(blur.mean(fresh, known) / deviation[:, None])[known].max(axis=0)
                      for blur, deviation in zip(blurs, null.deviation, strict=True)], axis=0)
    assert (largest > null.threshold(0.95)).mean() == pytest.approx(0.05, abs=0.03)
    assert null.threshold(0.99) > null.threshold(0.95) > null.threshold(0.8)


@pytest.mark.parametrize("turn", [(40, 0, 0), (-40, 5, 4), (10, 18, -12)])
def test_a_turned_face_is_laid_on_as_open3d_lays_it(surfaces, turn):
    reference = surfaces[0]
    rotation, shift = pose(*turn, shift=(30.0, -20.0, 820.0))
    other = Surface.of_face(made_face(40, (rotation, shift), noise=0.05))
    place, own = HeadPlace.find(reference), HeadPlace.find(other)
    found = align(other, reference, place=place, start=place.pose @ own.pose.inverse)
    true = Pose(*POSES[0]) @ Pose(rotation, shift).inverse
    assert (found.pose @ true.inverse).angle_deg < 0.35
    assert np.median(np.linalg.norm(found.pose.of(other.points) - true.of(other.points),
                                    axis=1)) < 0.4
    clouds = []
    for one in (other, reference):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(one.points))
        cloud.normals = o3d.utility.Vector3dVector(one.normals)
        clouds.append(cloud)
    start = np.eye(4)
    start[:3, :3], start[:3, 3] = found.pose.rotation, found.pose.shift
    theirs = o3d.pipelines.registration.registration_icp(
        *clouds, 2.0, start,
        o3d.pipelines.registration.TransformationEstimationPointToPlane()).transformation
    away = Pose(theirs[:3, :3], theirs[:3, 3]).of(other.points) - found.pose.of(other.points)
    assert np.median(np.linalg.norm(away, axis=1)) < 0.4


def test_distances_are_along_the_normals_of_the_places():
    face = made_face(3, noise=0.0)
    surface = Surface.of_face(face)
    sites = sites_of(surface)
    further = Surface(surface.points + 0.7 * surface.normals, surface.normals, surface.sigma)
    found, sigma = distances(further, sites)
    gentle = -sites.normals[:, 2] > 0.8
    assert np.nanmedian(found[gentle]) == pytest.approx(0.7, abs=0.01)
    assert np.nanpercentile(np.abs(found[gentle] - 0.7), 90) < 0.12
    assert np.nanmax(sigma) <= 0.4 + 1e-6
    away, _ = distances(surface.moved(Pose(np.eye(3), np.array([0, 0, 60.0]))), sites)
    assert np.isnan(away).mean() > 0.9


def test_a_mesh_without_sigma_is_compared_by_its_own_scatter():
    faces = [made_face(seed, POSES[seed % 6], height=height)
             for seed, height in ((0, 0.0), (1, 1.5))]
    meshes = [Surface.of_mesh(face.dense.points, None) for face in faces]
    assert (meshes[0].normals[:, 2] < 0.2).mean() > 0.98
    result = LaidOn.of(meshes, ["a", "b"], apart_mm=4.5).compare([0], [1])
    assert [result.names[one.peak] for one in result.verdict.changes] == ["left cheek"]


def test_what_is_no_face_is_named():
    flat = Surface.of_mesh(np.array([[0, 0, 700], [5, 0, 700], [0, 5, 700.0]]), None)
    with pytest.raises(ServiceError, match="B: has no face"):
        compare_surfaces([Surface.of_face(made_face(0))], [flat], names=["A", "B"])


def test_places_have_names_and_bone_weighs_more():
    assert region_name(np.array([40.0, 30.0, 0])) == "left cheek"
    assert region_name(np.array([-60.0, -30.0, 0])) == "right temple"
    assert region_name(np.array([3.0, 45.0, 0])) == "mouth"
    assert region_name(np.array([0.0, 10.0, 0])) == "nose"
    weights = rigidity(np.array([[0.0, -60, 0], [0, 45, 0], [30, -20, 0]]))
    assert weights[0] == 1 > weights[1] == weights[2] > 0


class _Words(HTMLParser):
    def __init__(self):
        super().__init__()
        self.words, self.sources = [], []

    def handle_data(self, data):
        self.words.append(data)

    def handle_starttag(self, _, attrs):
        self.sources += [value for name, value in attrs if name in ("src", "href")]


def test_what_is_told_agrees_in_all_forms(surfaces, raised):
    told = Told(raised, surfaces[0], ["a<b>.npz"] * 3, ["c.npz"] * 3)
    figures = json.loads(told.bytes_of(".json"))
    change = raised.verdict.changes[0]
    assert figures["changes"][0]["mean_mm"] == pytest.approx(change.mean_mm, abs=1e-4)
    assert figures["alignments"][0] is None
    assert f"{change.mean_mm:.2f} ± {change.half_mm:.2f} mm" in told.lines()[-1]
    words = _Words()
    words.feed(told.bytes_of(".html").decode())
    assert f"± {change.half_mm:.2f}" in words.words
    assert any("a<b>.npz" in one for one in words.words)
    assert all(source.startswith("data:image/png;base64,") for source in words.sources)
    image = cv2.imdecode(np.frombuffer(told.bytes_of(".png"), np.uint8), cv2.IMREAD_COLOR)
    blue, _, red = image[:image.shape[0] // 2].reshape(-1, 3).astype(int).T
    assert (red - blue > 100).sum() > 500, "the raised cheek is red"


def test_the_cloud_is_read_by_another_library(surfaces, raised, tmp_path):
    plyfile = pytest.importorskip("plyfile")
    (tmp_path / "a.ply").write_bytes(Told(raised, surfaces[0], ["a"], ["b"]).bytes_of(".ply"))
    vertices = plyfile.PlyData.read(tmp_path / "a.ply")["vertex"]
    assert len(vertices) == len(surfaces[0])
    peak = raised.sites.points[raised.verdict.changes[0].peak]
    near = np.linalg.norm(np.stack([vertices[k] for k in "xyz"], 1) - peak, axis=1) < 5
    assert (vertices["score"][near] > 1).all()
    assert 0.2 < np.mean(vertices["difference"][near]) < 0.8
