"""Files and folders for one user alone."""

import pytest

from denseface.service.errors import SettingsError
from denseface.service.runtime.files import private_folder


def test_a_private_folder_is_private(tmp_path):
    folder = private_folder(tmp_path / "a" / "b")
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o755)
    assert private_folder(folder).stat().st_mode & 0o777 == 0o700
    (tmp_path / "link").symlink_to(folder)
    with pytest.raises(SettingsError, match="must be a folder"):
        private_folder(tmp_path / "link")
