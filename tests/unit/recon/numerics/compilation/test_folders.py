"""Whose folders compiled code is taken from."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from denseface.recon.numerics.compilation import folders
from denseface.recon.numerics.compilation.folders import why_not_trusted, why_not_writable


@pytest.fixture
def owner(monkeypatch):
    """Make files appear to belong to others; give what sets whose."""
    owners = {}
    stat = Path.stat

    def with_owner(path, **how):
        found = stat(path, **how)
        return SimpleNamespace(st_mode=found.st_mode, st_gid=found.st_gid,
                               st_uid=owners.get(path, found.st_uid))

    monkeypatch.setattr(Path, "stat", with_owner)
    return owners


@pytest.fixture
def source(tmp_path):
    (tmp_path / "package" / "__pycache__").mkdir(parents=True)
    path = tmp_path / "package" / "kernels.py"
    path.touch()
    return path


OTHER = os.geteuid() + 1


@pytest.mark.parametrize("whose", ["package", "package/__pycache__"])
def test_a_folder_of_another_user_is_not_trusted(tmp_path, source, owner, whose):
    owner[tmp_path / whose] = OTHER
    folder = tmp_path / "package" / "__pycache__"
    assert why_not_trusted(folder, source) == f"{tmp_path / whose} belongs to another user"


def test_nor_is_a_file_of_another_user(tmp_path, source, owner):
    kept = tmp_path / "package" / "__pycache__" / "kept"
    kept.touch()
    owner[kept] = OTHER
    assert why_not_trusted(kept.parent, source, kept) == f"{kept} belongs to another user"


def test_whose_the_source_is_may_bring_the_code_too(tmp_path, source, owner):
    folder = tmp_path / "package" / "__pycache__"
    owner |= dict.fromkeys((source, folder, folder.parent), OTHER)
    assert not why_not_trusted(folder, source)
    assert "another user" in why_not_trusted(folder, tmp_path / "mine" / "kernels.py")


def test_who_can_replace_a_folder_above_can_bring_code(tmp_path, source):
    folder = tmp_path / "package" / "__pycache__"
    tmp_path.chmod(0o777)
    assert why_not_trusted(folder, source) == f"{tmp_path} can be written by others"
    tmp_path.chmod(0o1777)
    assert not why_not_trusted(folder, source), "none but its owner, as in /tmp"


def test_a_group_of_the_user_alone_is_no_other(tmp_path, source, monkeypatch):
    folder = tmp_path / "package" / "__pycache__"
    folder.chmod(0o775)
    monkeypatch.setattr(folders, "_is_own_group", lambda _: True)
    assert not why_not_trusted(folder, source)
    monkeypatch.setattr(folders, "_is_own_group", lambda _: False)
    assert why_not_trusted(folder, source) == f"{folder} can be written by others"


def test_why_a_folder_cannot_be_made_is_said(tmp_path, source):
    (tmp_path / "file").touch()
    assert why_not_writable(tmp_path / "file" / "folder", source) == (
        f"{tmp_path / 'file' / 'folder'}: Not a directory")
