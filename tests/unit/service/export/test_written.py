"""What is said of the files that were written."""

import pytest

from denseface.service.export import FORMATS, FaceFiles
from denseface.service.export.written import WrittenFiles, describe
from tests.unit.service.faces import small_face


@pytest.mark.parametrize("ending", FORMATS)
def test_each_format_is_told_with_what_opens_it(tmp_path, ending):
    face, files = small_face(), FaceFiles(tmp_path / f"face{ending.upper()}")
    files.write(face)
    (line,) = describe(files, face)
    what = "mesh of 102 points" if ending in (".obj", ".glb", ".stl") else "102 points"
    size = files.output.stat().st_size
    assert line.startswith(f"{files.output}: {what}, {size / 1000:.1f} kB; ")


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
