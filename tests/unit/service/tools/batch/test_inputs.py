"""What there is in folders, as a stream, and what it is called."""

import numpy as np
import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import FormatError, UsageError
from denseface.service.tools.batch.inputs import input_names, parts_of
from denseface.service.tools.batch.manifest import MANIFEST, claim_folder
from denseface.service.tools.batch.plan import Plan
from denseface.service.tools.frames import FrameChoice

PLAN = Plan(FrameChoice(10**7))


def made(top, *names):
    for name in names:
        path = top / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return top


def found(top, **more):
    return {part.name: part.source for part in parts_of(str(top), "in", **more)}


def test_recordings_and_frames_are_found_at_any_depth_and_no_two_names_are_the_same(tmp_path):
    top = made(tmp_path / "x", "a.oni", "a.npz", "a.NPZ", "b/a.oni", "b/c/d.npz", ".hidden/e.npz",
               "notes.txt", "b/a.calibration.json", "a.oni.d/00000.npz")
    (top / "back").symlink_to(top)
    assert found(top) == {
        f"in/{name}": str(top / source) for name, source in {
            "a.oni": "a.oni", "a": "a.npz", "a.NPZ": "a.NPZ", "b/a.oni": "b/a.oni",
            "b/c/d": "b/c/d.npz", "a.oni.d/00000": "a.oni.d/00000.npz"}.items()}
    kinds = {part.name: part.many for part in parts_of(str(top), "in")}
    assert [name for name, many in kinds.items() if many] == ["in/a.oni", "in/b/a.oni"]


def test_a_folder_of_pairs_is_one_source_and_one_without_any_is_asked_why(tmp_path):
    import cv2

    top = tmp_path / "scans"
    for name, image in (("depth", np.zeros((8, 8), np.uint16)),
                        ("color", np.zeros((8, 8, 3), np.uint8))):
        (top / "s" / name).mkdir(parents=True)
        cv2.imwrite(str(top / "s" / name / "0.png"), image)
    assert found(top) == {"in/s": str(top / "s")}
    (tmp_path / "empty").mkdir()
    assert found(tmp_path / "empty") == {"in": str(tmp_path / "empty")}
    assert found(made(tmp_path / "one.npz", "x.npz") / "x.npz") == {
        "in": str(tmp_path / "one.npz" / "x.npz")}


def test_faces_are_not_among_the_frames(tmp_path):
    made(tmp_path, "a.npz", "out/faces/a.npz")
    assert list(found(tmp_path, without=str(tmp_path / "out"))) == ["in/a"]


def test_inputs_keep_the_names_that_they_had(tmp_path):
    made(tmp_path, "one/take.oni", "two/take.oni", "two/TAKE.npz", "take-2.oni")
    one, two = (str(tmp_path / name / "take.oni") for name in ("one", "two"))
    first = input_names([one, str(tmp_path / "x.calibration.json")], {})
    assert first == {one: "take"}
    both = input_names([two, one, str(tmp_path / "two/TAKE.npz")], first)
    assert both[one] == "take"
    assert len({name.casefold() for name in both.values()}) == 3
    assert input_names([one, two], both) == both


@pytest.mark.parametrize(("given", "why"), [
    ("openni2:", "denseface up"), ("", "no such file"), ("none.oni", "none.oni: no such file"),
    ("x.txt", "x.txt: expected a .npz or .oni file or a folder"),
    ("x.calibration.json", "calibrations alone"),
])
def test_what_is_no_input_is_named(tmp_path, monkeypatch, given, why):
    monkeypatch.chdir(made(tmp_path, "x.txt", "x.calibration.json"))
    with pytest.raises(UsageError, match=why):
        input_names([given], {})


def test_a_folder_is_of_one_way_to_make_faces(tmp_path):
    source, folder = str(made(tmp_path, "a.npz") / "a.npz"), tmp_path / "out"
    names = claim_folder(folder, PLAN, [source])
    assert names == claim_folder(folder, PLAN, [source]) == {source: "a"}
    other = Plan(FrameChoice(10**7), Settings(smoothing=6), ".glb", every=5)
    with pytest.raises(UsageError, match=r"out: its faces were made otherwise: every was 1, is 5; "
                                         r"format was ply, is glb; smoothing was not given, is 6"):
        claim_folder(folder, other, [source])
    calibration = tmp_path / "c.json"
    calibration.write_text("{}")
    of_file = Plan(FrameChoice(10**7, calibration))
    claim_folder(tmp_path / "out2", of_file, [source])
    calibration.write_text("{ }")
    with pytest.raises(UsageError, match="the calibration's contents changed"):
        claim_folder(tmp_path / "out2", of_file, [source])


def test_a_folder_with_other_things_in_it_or_a_broken_manifest_is_refused(tmp_path):
    source = str(made(tmp_path, "a.npz", "full/letter.txt") / "a.npz")
    with pytest.raises(UsageError, match=f"full: has files in it and no {MANIFEST}"):
        claim_folder(tmp_path / "full", PLAN, [source])
    claim_folder(tmp_path / "out", PLAN, [source])
    for text in ("", "[]", '{"plan": {}, "inputs": {"/a": "../b"}}', '{"plan": 1, "inputs": {}}'):
        (tmp_path / "out" / MANIFEST).write_text(text)
        with pytest.raises(FormatError, match=f"{MANIFEST}: is no manifest of a batch"):
            claim_folder(tmp_path / "out", PLAN, [source])


def test_faces_are_not_written_where_they_are_read(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    with pytest.raises(UsageError, match="out: is where faces are written"):
        claim_folder(folder, PLAN, [str(folder)])


def test_a_plan_is_the_same_in_another_process():
    plan = Plan(FrameChoice(10**6, rotation=90), Settings(smoothing=6), ".obj", report=True,
                picture=True, textured=True, every=3)
    assert Plan.of_json(plan.to_json()) == plan
    with pytest.raises(UsageError, match=r"a worker has denseface .*, the batch is of 0\.0\.1"):
        Plan.of_json(plan.to_json().replace('"version": "', '"version": "0.0.1", "was": "'))
