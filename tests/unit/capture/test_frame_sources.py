"""What a frame says it was read from, and that no folder of the machine is named."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from denseface.capture import open_source
from denseface.capture.burst import fuse
from denseface.capture.frame import FrameOrigin
from denseface.capture.image_pair import ImagePairSource
from denseface.capture.npz import load_frame, save_frame
from denseface.service.protocol.payload import FrameHeader
from tests.unit.frames import calibration, frame

ROOM = frame(np.full((120, 160), 900, np.uint16), np.full((120, 160, 3), 90, np.uint8))
RECORDING = Path(__file__).resolve().parents[3] / "fixtures/recorded_oni/frontal_700.oni"


def origins(source):
    with source:
        return [one.origin.source for one in source]


def test_a_frame_file_is_named_unless_it_names_what_it_is_of(tmp_path):
    save_frame(ROOM, tmp_path / "room.npz")
    assert origins(open_source(tmp_path / "room.npz")) == ["room.npz"]
    save_frame(ROOM.with_source("take.oni#3"), tmp_path / "room.npz")
    assert origins(open_source(tmp_path)) == ["take.oni#3"]
    assert load_frame(tmp_path / "room.npz").origin.source == "take.oni#3"


def test_a_recording_s_frames_are_numbered_in_each_pass(tmp_path):
    shutil.copy(RECORDING, tmp_path / "take.oni")
    with open_source(tmp_path / "take.oni") as source:
        numbers = [[one.origin.source for one in source] for _ in range(2)]
    assert numbers == 2 * [["take.oni#0", "take.oni#1", "take.oni#2"]]


def test_image_pairs_are_named_and_those_of_a_folder_numbered(tmp_path):
    for number in range(2):
        for name, image in (("depth", ROOM.depth), ("color", ROOM.color)):
            (tmp_path / "set" / name).mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(tmp_path / "set" / name / f"{number}.png"), image)
    assert origins(open_source(tmp_path / "set")) == ["set#0", "set#1"]
    one = ImagePairSource(*(tmp_path / "set" / name / "1.png" for name in ("depth", "color")))
    assert origins(one) == ["1.png + 1.png"]


def test_a_calibration_is_named_without_its_folder(tmp_path):
    save_frame(ROOM, tmp_path / "room.npz")
    (tmp_path / "mine.json").write_text(calibration().model_dump_json())
    with open_source(tmp_path / "room.npz", tmp_path / "mine.json") as source:
        found = next(iter(source))
    assert found.calibration_origin == "argument mine.json"
    assert str(tmp_path) not in repr((found.origin, found.calibration_origin))


def test_what_a_frame_was_read_from_goes_over_the_wire_and_stays_with_a_burst():
    one = ROOM.with_source("take.oni#3")
    header, arrays = FrameHeader.of(one)
    assert header.join(arrays).origin == one.origin
    with pytest.raises(ValidationError, match="must be a line of text"):
        FrameHeader.model_validate(header.model_dump() | {"source": "a\nb"})
    assert fuse([one, one]).origin.source == "take.oni#3"


@pytest.mark.parametrize(("name", "shown"), [
    ("a\nb.npz", "a?b.npz"), ("\udcff.npz", "?.npz"), ("ä.npz", "ä.npz")])
def test_a_name_that_is_no_line_of_text_is_shown_as_one(name, shown):
    assert FrameOrigin(source=name).source == shown
