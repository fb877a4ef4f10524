"""Other people's folders: nothing in them is changed, and nobody else gets at what is put there."""

import stat

import pytest

from tests.system.running import denseface, hub_alone


def mode_of(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture
def shared(tmp_path):
    """Give a folder that everybody may use, as /tmp is."""
    folder = tmp_path / "shared"
    folder.mkdir()
    folder.chmod(0o1777)
    return folder


@pytest.mark.parametrize("mode", [0o1777, 0o777, 0o770])
@pytest.mark.parametrize("command", [("hub",), ("up", "--source", "fixtures/none.oni")])
def test_a_socket_where_others_could_take_the_hub_s_place_is_refused(shared, mode, command):
    shared.chmod(mode)
    done = denseface(*command, "--address", f"ipc://{shared}/hub", "--data",
                     shared.with_name("data"))
    assert done.returncode == 2
    assert f"{shared}: others may write there (mode {mode:o})" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert mode_of(shared) == mode
    assert list(shared.iterdir()) == []


def test_a_client_does_not_trust_a_socket_that_anyone_could_have_made(shared):
    for command in (("press",), ("worker",), ("capture", "--source", "fixtures/none.oni")):
        done = denseface(*command, "--address", f"ipc://{shared}/hub")
        assert done.returncode == 2, done.stderr
        assert f"{shared}: others may write there (mode 1777)" in done.stderr


def test_a_socket_in_a_folder_that_others_read_is_its_user_s_alone(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    folder.chmod(0o755)
    with hub_alone(f"ipc://{folder}/hub", tmp_path / "data"):
        done = denseface("status", "--address", f"ipc://{folder}/hub")
        assert done.returncode == 0, done.stderr
        assert mode_of(folder) == 0o755
        assert [mode_of(path) & 0o077 for path in folder.iterdir()] == [0, 0]
    assert mode_of(folder) == 0o755


@pytest.mark.parametrize("name", ["hub", "hub.publications"])
@pytest.mark.parametrize("kind", ["file", "folder", "link"])
def test_a_file_in_the_socket_s_place_is_not_removed(tmp_path, name, kind):
    """Before it binds, libzmq removes whatever has the name."""
    path = tmp_path / name
    (tmp_path / "precious").write_text("somebody's")
    match kind:
        case "file":
            path.write_text("somebody's")
        case "folder":
            path.mkdir()
        case "link":
            path.symlink_to("precious")
    before = path.lstat()
    done = denseface("hub", "--address", f"ipc://{tmp_path}/hub", "--data", tmp_path / "data")
    assert done.returncode == 2
    assert f"ipc://{path}: there is a file of that name" in done.stderr
    assert path.lstat() == before


@pytest.mark.parametrize("mode", [0o755, 0o1777, 0o770, 0o701])
@pytest.mark.parametrize("what", ["data", "keys"])
def test_an_open_folder_is_refused_for_faces_and_for_keys(shared, tmp_path, what, mode):
    shared.chmod(mode)
    (shared / "notes.txt").write_text("somebody's")
    done = (denseface("keys", "new", "hub", "--keys", shared) if what == "keys" else
            denseface("hub", "--data", shared, "--address", f"ipc://{tmp_path}/run/hub"))
    assert done.returncode == 2
    assert f"{shared}: others may use this folder (mode {mode:o})" in done.stderr
    assert "chmod 700" in done.stderr
    assert mode_of(shared) == mode
    assert [path.name for path in shared.iterdir()] == ["notes.txt"]


def test_a_folder_that_others_could_exchange_is_refused(shared):
    """Whoever may rename the data folder may put one of his own there."""
    shared.chmod(0o777)
    data = shared / "data"
    data.mkdir(mode=0o700)
    done = denseface("hub", "--data", data, "--address", f"ipc://{shared.parent}/run/hub")
    assert done.returncode == 2
    assert f"{shared}: others may exchange what is in it (mode 777)" in done.stderr


def test_the_hub_believes_no_list_of_keys_that_others_may_write_to(tmp_path):
    keys = tmp_path / "keys"
    for arguments in (("new", "hub"), ("new", "one"),
                      ("allow", "one", keys / "one.public", "worker")):
        assert denseface("keys", *arguments, "--keys", keys).returncode == 0
    (keys / "allowed").chmod(0o777)
    done = denseface("hub", "--keys", keys, "--data", tmp_path / "data",
                     "--address", f"ipc://{tmp_path}/hub", "--listen", "tcp://127.0.0.1:5990")
    assert done.returncode == 2
    assert f"{keys}/allowed: others may write there (mode 777)" in done.stderr
