"""Every head looks like one to OpenCV, and its face is where a face is."""

import cv2
import numpy as np
import pytest

from tests.simulator import (
    KINECT_DEFAULT,
    Deformed,
    Label,
    Person,
    Scene,
    head_names,
    load_head,
    patch,
    simulate,
)
from tests.simulator.camera_views import color_view

HEADS = pytest.mark.parametrize("name", head_names())


@pytest.fixture(scope="module")
def cascades():
    folder = cv2.data.haarcascades
    return [cv2.CascadeClassifier(f"{folder}haarcascade_frontalface_{name}.xml")
            for name in ("default", "alt2")]


def check_one_face(image, distance, cascades):
    """Check that each cascade finds the face where the head is, at a face's size."""
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    calibration = KINECT_DEFAULT.calibration
    u, v = calibration.color.project(
        calibration.depth_to_color.apply(np.array([0.0, 0.0, distance])))
    for cascade in cascades:
        boxes = cascade.detectMultiScale(gray, 1.1, 4, minSize=(50, 50))
        assert len(boxes) == 1
        x, y, w, h = boxes[0]
        assert abs(x + w / 2 - u) < 0.15 * w
        assert abs(y + h / 2 - v) < 0.2 * h
        assert 110 < w * distance / calibration.color.fx < 210


@HEADS
def test_opencv_finds_exactly_one_face_at_a_metre(name, cascades):
    scene = Scene(people=(Person(head=name, distance_mm=1000),))
    image = np.rint(color_view(scene, KINECT_DEFAULT)).astype(np.uint8)
    check_one_face(image, 1000, cascades)


@HEADS
def test_the_face_is_one_piece_of_a_faces_size(name, cascades):
    shown = simulate(Scene(people=(Person(head=name, distance_mm=700),)))[0]
    check_one_face(shown.frame.rgb, 700, cascades)
    truth = shown.truth
    face = (truth.labels == Label.FACE).astype(np.uint8)
    _, _, stats, _ = cv2.connectedComponentsWithStats(face)
    assert stats[1:, cv2.CC_STAT_AREA].max() > 0.99 * face.sum()
    points = truth.face_points()
    width, height = np.ptp(points[:, 0]), np.ptp(points[:, 1])
    assert 120 < width < 175
    assert 150 < height < 230
    # Hair, ears and neck are there and are not face.
    assert (truth.labels == Label.HEAD).sum() > 0.15 * face.sum()
    marks = load_head(name).landmarks
    below = np.array([[0.0, marks.chin[0] + 25, marks.neck[2] - marks.neck[3]]])
    assert not load_head(name).face_region(below)[0]
    nose = np.array([[0.0, *marks.nose_tip]])
    assert load_head(name).face_region(nose)[0]


@HEADS
def test_the_head_frame_has_its_origin_behind_the_middle_of_the_face(name):
    head = load_head(name)
    assert head.vertices.dtype == np.float32
    assert head.faces.max() < len(head.vertices)
    marks = head.landmarks
    assert marks.hairline[0] + marks.chin[0] == pytest.approx(0, abs=1e-6)
    assert marks.bridge[1] == 0
    assert marks.nose_tip[1] < -8
    assert abs(head.vertices[:, 0].mean()) < 5


@pytest.mark.parametrize("kind", list(Deformed))
def test_a_deformation_moves_one_side_by_millimetres(kind):
    head, plain = load_head(f"procedural+{kind}"), load_head("procedural")
    moved = np.linalg.norm(head.vertices - plain.vertices, axis=1)
    assert 1.5 < moved.max() < 6.5
    x, y, radius = patch(kind, plain.landmarks)
    near = np.hypot(plain.vertices[:, 0] - x, plain.vertices[:, 1] - y) < 2 * radius
    assert moved[~near].max() < 0.5
    assert head.landmarks == plain.landmarks
    if x:
        image = np.hypot(plain.vertices[:, 0] + x, plain.vertices[:, 1] - y) < radius / 2
        assert moved[image].max() < 0.5


def test_an_unknown_deformation_is_named():
    with pytest.raises(ValueError, match="'swirl'"):
        load_head("procedural+swirl")


def test_a_head_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="'nobody'"):
        load_head("nobody")


def test_scans_come_only_with_their_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("DENSEFACE_SHARED", str(tmp_path))
    assert head_names() == ["procedural"]
    with pytest.raises(ValueError, match="'lps'"):
        load_head.__wrapped__("lps")
