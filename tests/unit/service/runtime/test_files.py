"""Files and folders for one user alone."""

import os
import stat

import pytest

from denseface.service.errors import SettingsError
from denseface.service.runtime.files import private_folder, socket_folder, write_atomically


def mode_of(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize("make", [private_folder, socket_folder])
def test_a_new_folder_is_private(tmp_path, make):
    folder = make(tmp_path / "a" / "b")
    assert mode_of(folder) == 0o700
    assert make(folder) == folder
    (tmp_path / "link").symlink_to(folder)
    with pytest.raises(SettingsError, match="must be a folder"):
        make(tmp_path / "link")


@pytest.mark.parametrize("mode", [0o755, 0o750, 0o701, 0o777, 0o1777])
def test_a_folder_that_is_there_keeps_its_mode_and_is_refused(tmp_path, mode):
    tmp_path.chmod(mode)
    with pytest.raises(SettingsError, match=f"mode {mode:o}.*chmod 700 {tmp_path}"):
        private_folder(tmp_path)
    assert mode_of(tmp_path) == mode


@pytest.mark.parametrize(("mode", "taken"), [
    (0o755, True), (0o711, True), (0o775, False), (0o777, False), (0o1777, False)])
def test_a_socket_goes_where_nobody_else_can_put_one(tmp_path, mode, taken):
    tmp_path.chmod(mode)
    if taken:
        assert socket_folder(tmp_path) == tmp_path
    else:
        with pytest.raises(SettingsError, match=f"others may write there .mode {mode:o}"):
            socket_folder(tmp_path)
    assert mode_of(tmp_path) == mode


@pytest.mark.parametrize("make", [private_folder, socket_folder])
def test_the_folders_above_are_looked_at_too(tmp_path, make):
    tmp_path.chmod(0o1777)
    folder = make(tmp_path / "own")  # sticky: as in /tmp, nobody else may rename it
    tmp_path.chmod(0o777)
    with pytest.raises(SettingsError, match="others may exchange what is in it"):
        make(folder)


@pytest.mark.parametrize(("mode", "umask", "found"), [
    (None, 0o022, 0o644), (None, 0o077, 0o600), (0o600, 0o000, 0o600), (0o640, 0o077, 0o640)])
def test_a_file_has_the_mode_that_is_asked_for(tmp_path, mode, umask, found):
    before = os.umask(umask)
    try:
        write_atomically(tmp_path / "file", [b"x"], mode=mode)
    finally:
        os.umask(before)
    assert mode_of(tmp_path / "file") == found
