"""What is said of the files that were written."""

import numpy as np
import pytest

from denseface.service.export import FORMATS, ExportOptions, FaceFiles
from denseface.service.export.printing import Printing
from denseface.service.export.written import WrittenFiles, describe
from tests.unit.service.faces import small_face


@pytest.mark.parametrize("ending", FORMATS)
def test_each_format_is_told_with_what_opens_it(tmp_path, ending):
    face, files = small_face(), FaceFiles(tmp_path / f"face{ending.upper()}")
    files.write(face)
    (line,) = describe(files, face)
    high = f"{np.ptp(face.dense.points[:, 1]):.0f} mm high, life size"
    what = {".obj": "mesh of 102 points", ".glb": "mesh of 102 points",
            ".stl": f"relief on a plate, the face {high}",
            ".3mf": f"relief on a plate, the face {high}", ".png": "picture of the face",
            ".webp": "the face, turning to and fro", ".mp4": "the face, turning to and fro"}.get(
        ending, "102 points")
    size = files.output.stat().st_size / 1000
    assert line.startswith(f"{files.output}: {what}, {size:.{0 if size >= 100 else 1}f} kB; ")


@pytest.mark.parametrize(("printing", "what"), [
    (Printing("mask", height_mm=40.0), "hollow mask, the face 40 mm high, "),
    (Printing("open"), "mesh of 102 points, ")])
def test_a_solid_is_told_as_what_it_is(tmp_path, printing, what):
    face = small_face()
    files = FaceFiles(tmp_path / "face.stl", options=ExportOptions(printing=printing))
    files.write(face)
    assert describe(files, face)[0].startswith(f"{files.output}: {what}")


def test_nothing_is_said_of_nothing():
    assert describe(FaceFiles(), small_face()) == []
    assert WrittenFiles().lines() == []


@pytest.mark.parametrize(("size", "words"), [
    (0, "0 bytes"), (999, "999 bytes"), (1000, "1.0 kB"), (123_456, "123 kB"),
    (6_123_456, "6.1 MB"), (12_345_678_901, "12.3 GB")])
def test_sizes_are_told_in_words(tmp_path, size, words):
    path = tmp_path / "f.ply"
    with path.open("wb") as file:
        file.truncate(size)
    written = WrittenFiles()
    written.add(path, None)
    assert written.lines() == [f"{tmp_path}/f.ply: {words}; MeshLab, CloudCompare and Blender "
                               "open it"]
