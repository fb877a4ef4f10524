import pytest

from denseface.capture.errors import DriverError
from denseface.capture.openni2 import _library as library
from denseface.capture.openni2._path import ascii_name


def test_the_environment_names_the_folder(tmp_path, monkeypatch):
    (tmp_path / "libOpenNI2.so").touch()
    monkeypatch.delenv("OPENNI2_REDIST64", raising=False)
    monkeypatch.setenv("OPENNI2_REDIST", str(tmp_path))
    assert library.find_library() == tmp_path


def test_a_folder_without_the_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENNI2_REDIST64", str(tmp_path))
    with pytest.raises(DriverError, match=f"OPENNI2_REDIST64={tmp_path}: no libOpenNI2.so"):
        library.find_library()


def test_a_missing_library_names_the_debian_package(monkeypatch):
    for variable in ("OPENNI2_REDIST64", "OPENNI2_REDIST"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(library, "_NAME", "libNotThere.so")
    with pytest.raises(DriverError, match=r"libNotThere\.so not found in .*libopenni2-dev"):
        library.find_library()


def test_ascii_names_are_left_alone(tmp_path):
    with ascii_name(tmp_path / "a.oni") as name:
        assert name == str(tmp_path / "a.oni").encode()


@pytest.mark.parametrize("odd", ["ä.oni", "d" * 120 + "/" + "e" * 200 + ".oni"])
def test_odd_names_get_a_link(tmp_path, odd):
    path = tmp_path / odd
    path.parent.mkdir(exist_ok=True)
    path.write_text("here")
    with ascii_name(path) as name:
        assert name.isascii()
        assert len(name) < 256
        with open(name) as file:  # noqa: PTH123 # a name in bytes
            assert file.read() == "here"


def test_a_new_file_in_an_odd_folder(tmp_path):
    folder = tmp_path / "ö"
    folder.mkdir()
    with ascii_name(folder / "new.oni") as name, open(name, "w") as file:  # noqa: PTH123
        file.write("made")
    assert (folder / "new.oni").read_text() == "made"
