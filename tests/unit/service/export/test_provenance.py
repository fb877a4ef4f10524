"""Where a face comes from, as each format says it, read back by others where they can."""

import io
import json
import re
import struct
from dataclasses import replace

import numpy as np
import open3d as o3d
import pytest
from PIL import Image

from denseface.capture.frame import FrameOrigin
from denseface.recon.settings import Settings
from denseface.service.export import FORMATS, load_face, save_face
from denseface.service.export.options import LIKENESS
from denseface.service.export.photo import to_photo
from denseface.service.export.provenance import comments, provenance, stl_header
from denseface.service.export.refusal import draw_refusal
from denseface.service.export.render import portrait
from tests.unit.service.faces import small_face, small_frame

SETTINGS = Settings(ratio=9).model_dump_json()
TOLD = {"generator": "denseface 1.2.3", "capture_id": "visit-7",
        "captured_at": "2026-11-29T12:00:00.033+00:00", "sensor": "A00365",
        "source": "take.oni#12", "calibration": "beside: take.calibration.json",
        "settings": SETTINGS}


def face(**changes):
    one = small_face()
    fields = {name: text for name, text in TOLD.items() if name not in ("generator", "settings")}
    report = one.report.model_copy(update={
        **fields, "version": "1.2.3", "settings": Settings(ratio=9), **changes})
    return replace(one, report=report)


@pytest.fixture
def saved(tmp_path):
    def save(ending, **changes):
        path = tmp_path / f"face{ending}"
        save_face(face(**changes), path)
        assert str(tmp_path).encode() not in path.read_bytes()
        return path

    return save


def lines(data, mark):
    return dict(line.split(" ", 1) for line in re.findall(rf"^{mark} (\w+ .*)$", data, re.M)
                if line.split()[0] in TOLD)


def test_only_what_is_known_is_told():
    assert provenance(face().report) == TOLD
    assert list(provenance(small_face().report)) == ["generator", "calibration", "settings"]


@pytest.mark.parametrize(("ending", "mark"), [(".ply", "comment"), (".obj", "#"), (".pcd", "#")])
def test_text_headers_have_a_line_for_each(saved, ending, mark):
    header = saved(ending).read_bytes()[:2000].decode("ascii", "replace")
    assert lines(header, mark) == TOLD


@pytest.mark.parametrize("ending", [".ply", ".pcd", ".obj", ".stl", ".glb"])
@pytest.mark.parametrize("name", ["Straße\n\x07 \\", "x" * 4096])
def test_whatever_a_source_is_called_other_programs_read_the_file(saved, ending, name):
    path = str(saved(ending, source=name, calibration=name, sensor=name))
    if ending in (".ply", ".pcd"):
        count = len(o3d.io.read_point_cloud(path).points)
    else:
        count = len(o3d.io.read_triangle_mesh(path).vertices)
    assert count >= len(small_face().dense)


def test_glb_says_it_in_its_asset(saved):
    data = saved(".glb").read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    asset = json.loads(data[20:20 + size])["asset"]
    assert asset == {"version": "2.0", "generator": TOLD["generator"], "copyright": LIKENESS,
                     "extras": {name: TOLD[name] for name in TOLD if name != "generator"}}


def test_npz_has_the_whole_report(saved):
    assert provenance(load_face(saved(".npz")).report) == TOLD


def test_stl_says_what_fits_into_its_80_bytes(saved):
    header = saved(".stl").read_bytes()[:80].rstrip(b"\0").decode()
    assert header == "by denseface, mm, z up; 2026-11-29T12:00:00.033+00:00; take.oni#12; A00365"
    for length in range(200):
        long = stl_header(face(source="s" * length, sensor="ä" * 20).report)
        assert len(long) == 80
        assert long.startswith(b"by denseface, mm; 2026-11-29T12:00:00.033+00:00")


def test_pictures_say_it_to_other_programs():
    picture = Image.open(io.BytesIO(portrait(face(sensor="Straße"), 64)))
    picture.load()
    assert picture.text == TOLD | {"sensor": "Straße"}


def test_pictures_of_a_frame_say_where_it_comes_from():
    frame = replace(small_frame(), calibration_origin=TOLD["calibration"], origin=FrameOrigin(
        TOLD["sensor"], TOLD["captured_at"], source=TOLD["source"]))
    for data in (to_photo(frame), draw_refusal(frame, [], "no face")):
        picture = Image.open(io.BytesIO(data))
        picture.load()
        assert picture.text.pop("generator").startswith("denseface ")
        assert picture.text == {name: TOLD[name] for name in (
            "captured_at", "sensor", "source", "calibration")}
    assert np.asarray(Image.open(io.BytesIO(to_photo(frame)))).tolist() == frame.rgb.tolist()


def test_comments_are_lines_that_every_reader_takes():
    for line in comments(face(source="a\\", calibration="ä" * 4096).report):
        assert line.isascii()
        assert line.isprintable()
        assert len(line) < 500
        assert not line.endswith("\\")


def test_every_format_is_looked_at_here():
    assert set(FORMATS) == {
        ".ply", ".pcd", ".npz", ".obj", ".glb", ".stl",
        ".3mf", ".png", ".webp", ".mp4"}  # these by `denseface info`, in its own test
