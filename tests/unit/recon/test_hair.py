"""A head with hair, of which the sensor sees less than half: the face has an even outline."""

from denseface.recon import reconstruct
from tests.outlines import outline_faults
from tests.simulator import KINECT_CALIBRATED, Label, Person, Scene, measure, simulate


def test_hair_leaves_hardly_a_tongue_or_island_and_no_pin_holes():
    scene = Scene((Person(distance_mm=650, hair=True),), holes=1.0)
    shot, = simulate(scene, KINECT_CALIBRATED, seed=5)
    hair = shot.truth.points[shot.truth.labels == Label.HEAD]
    assert len(hair) > 20_000
    face = reconstruct(shot.frame)
    faults = outline_faults(face.dense)
    # What a model adds past the outline (0056) leaves slivers.
    assert faults.tongues <= 3
    assert faults.tongues_mm2 < 30
    assert faults.islands <= 1
    assert faults.holes == 0
    assert faults.bays_mm2 < 80  # 140 before
    accuracy = measure(face, shot.truth, shot.frame)
    assert accuracy.lost < 0.01
    assert accuracy.covered > 0.95
