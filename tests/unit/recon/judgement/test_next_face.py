"""What is no face, or may be none, is passed for what else is there."""

import pytest

from denseface.recon import NoFaceError, pipeline, reconstruct
from denseface.recon.detection import REJECTED
from denseface.recon.judgement import Judgement
from tests.simulator import Person, Scene, simulate

FAR_MM = 1100.0


@pytest.fixture(scope="module")
def frame():
    people = (Person("procedural", 700.0, offset_mm=(-160.0, 0.0)),
              Person("procedural", FAR_MM, offset_mm=(230.0, 0.0)))
    return simulate(Scene(people, decor=3), seed=12)[0].frame


@pytest.fixture
def judged(monkeypatch):
    """Let the faces have these scores, in the order in which they are shaped."""
    def by(*scores):
        left = list(scores)

        def judge(_surface):
            score = left.pop(0)
            return Judgement(score, "" if score >= 0.5 else "round like a tin", None)
        monkeypatch.setattr(pipeline, "judge_shape", judge)
        return left
    return by


def depth_of(face):
    return face.dense.points[:, 2].mean()


def test_a_sure_face_is_taken_and_nothing_else_looked_at(frame, judged):
    left = judged(0.95, 0.99)
    face = reconstruct(frame)
    assert depth_of(face) < 900
    assert face.report.face_score == 0.95
    assert left == [0.99]


@pytest.mark.parametrize(("nearer", "verdict"), [(0.1, REJECTED), (0.6, "a face, perhaps")])
def test_a_sure_farther_face_is_taken_instead(frame, judged, nearer, verdict):
    judged(nearer, 0.95)
    face = reconstruct(frame)
    assert depth_of(face) > 1000
    assert face.report.candidates[0].verdict == "chosen"
    (passed,) = [one for one in face.report.candidates if one.verdict == verdict
                 and one.depth_mm < 800][-1:]
    assert passed.box[0] < face.report.face_box[0]


def test_of_doubtful_faces_the_surest_is_taken(frame, judged):
    judged(0.7, 0.6, 0.5)
    assert depth_of(reconstruct(frame)) < 900


def test_where_none_is_a_face_the_nearest_is_named(frame, judged):
    judged(0.1, 0.2, 0.3)
    with pytest.raises(NoFaceError, match=r"is round like a tin \(score 0.10, a face has 0.5") as e:
        reconstruct(frame)
    assert e.value.candidates[0].verdict == REJECTED
