"""Key files and the allow-list."""

import errno
import json
import os
from pathlib import Path

import pytest

from denseface.service.cli import main
from denseface.service.errors import KeyFileError
from denseface.service.protocol.roles import Role
from denseface.service.security import (
    AllowList,
    KeyPair,
    allow,
    new_pair,
    read_pair,
    read_public,
    revoke,
)
from tests.waiting import until

ROLES = frozenset({Role.WORKER})


@pytest.fixture
def keys(tmp_path):
    return tmp_path / "keys"


def test_a_pair_is_private_and_read_back(keys):
    secret, public = new_pair(keys, "hub")
    assert keys.stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in (secret, public)} == {0o600}
    pair = read_pair(secret)
    assert read_public(public) == pair.public == read_public(pair.public)
    assert pair.secret not in public.read_text()
    assert pair.secret not in repr(pair)
    with pytest.raises(KeyFileError, match=r"hub\.secret: exists"):
        new_pair(keys, "hub")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o622])
def test_a_secret_that_others_can_read_is_refused(keys, mode):
    secret, _ = new_pair(keys, "hub")
    secret.chmod(mode)
    with pytest.raises(KeyFileError, match=rf"hub\.secret.*mode {mode:o}"):
        read_pair(secret)


@pytest.mark.parametrize("name", ["", "../x", ".x", "a b", "x" * 65, "a/b"])
def test_a_name_is_a_file_s(keys, name):
    with pytest.raises(KeyFileError, match="key name"):
        new_pair(keys, name)
    with pytest.raises(KeyFileError, match="key name"):
        allow(keys, name, KeyPair.generate().public, ROLES)
    with pytest.raises(KeyFileError, match="key name"):
        revoke(keys, name)


@pytest.mark.parametrize(("text", "message"), [
    (b"", "not a key file"), (b"\0" * 10, "not a key file"), (b"x" * 5000, "at most 4096 bytes"),
    (b'{"name": "a", "public_key": "short"}', "40 characters"),
    (b'{"name": "a", "public_key": "' + b"1" * 40 + b'", "more": 1}', "not a key file")])
def test_what_is_no_key_is_named(tmp_path, text, message):
    path = tmp_path / "other"
    path.write_bytes(text)
    with pytest.raises(KeyFileError, match=message):
        read_public(path)


def test_the_halves_of_two_pairs_are_none(keys):
    secret, _ = new_pair(keys, "a")
    text = json.loads(secret.read_text())
    secret.write_text(json.dumps(text | {"public_key": KeyPair.generate().public}))
    with pytest.raises(KeyFileError, match="do not belong together"):
        read_pair(secret)
    _, public = new_pair(keys, "b")
    with pytest.raises(KeyFileError, match=r"b\.public: holds a public key"):
        read_pair(public)


def test_a_secret_key_is_given_to_nobody(keys):
    """Neither to the allow-list, which others read, nor in place of the hub's public one."""
    secret, _ = new_pair(keys, "kiosk")
    with pytest.raises(KeyFileError, match=r"kiosk\.secret: holds a secret key.*kiosk\.public"):
        read_public(secret)
    copied = secret.rename(keys / "mine")  # by its contents, whatever its name
    with pytest.raises(KeyFileError, match="mine: holds a secret key"):
        read_public(copied)


@pytest.mark.parametrize("forgotten", ["kiosk.public", "kiosk.secret"])
def test_a_secret_key_that_is_pasted_is_known_by_its_pair(keys, forgotten):
    pair = read_pair(new_pair(keys, "kiosk")[0])
    (keys / forgotten).unlink()
    (keys / "a.public").write_text("no key")
    with pytest.raises(KeyFileError, match=r"the secret key of kiosk, .*make a new pair") as caught:
        allow(keys, "front", pair.secret, ROLES)
    assert pair.public in str(caught.value)
    assert pair.secret not in str(caught.value)
    assert len(AllowList(keys)) == 0
    allow(keys, "front", pair.public, ROLES)


def test_what_is_neither_a_file_nor_a_key_is_named():
    with pytest.raises(KeyFileError, match=r"abc: no such file, nor a key: expected NAME\.public"):
        read_public("abc")


def test_a_folder_is_no_key(tmp_path):
    with pytest.raises(KeyFileError):
        read_public(tmp_path)


def test_the_list_is_live(keys):
    allow_list = AllowList(keys)
    assert (len(allow_list), allow_list.refresh()) == (0, False)
    one = allow(keys, "a", KeyPair.generate().public, ROLES)
    assert allow_list.refresh()
    assert not allow_list.refresh()
    assert allow_list.get(one.public) == one
    assert allow_list.has_token(one.token)
    more = allow(keys, "a", one.public, ROLES | {Role.PRESSER})
    assert allow_list.refresh()
    assert (allow_list.has_token(one.token), allow_list.has_token(more.token)) == (False, True)
    revoke(keys, "a")
    assert allow_list.refresh()
    assert allow_list.get(one.public) is None
    assert (allow_list.has_token(more.token), len(allow_list)) == (False, 0)
    with pytest.raises(KeyFileError, match="no key of that name"):
        revoke(keys, "a")


def test_a_name_and_a_key_belong_together(keys):
    one, other = KeyPair.generate().public, KeyPair.generate().public
    allow(keys, "a", one, ROLES)
    with pytest.raises(KeyFileError, match="in use: a"):
        allow(keys, "b", one, ROLES)
    with pytest.raises(KeyFileError, match="in use: a"):
        allow(keys, "a", other, ROLES)


@pytest.mark.parametrize("damage", [
    lambda path: path.write_text("{}"),
    lambda path: path.write_text(path.read_text().replace("worker", "king")),
    lambda path: path.write_bytes(os.urandom(100)),
    lambda path: path.chmod(0o622),
    lambda path: path.rename(path.with_name("a b")),
    lambda path: (path.unlink(), path.mkdir()),
    lambda path: (path.unlink(), path.symlink_to("nothing")),
])
def test_a_damaged_file_keeps_its_key_out_and_no_other(keys, damage):
    one, other = (allow(keys, name, KeyPair.generate().public, ROLES) for name in "ab")
    allow_list = AllowList(keys)
    assert len(allow_list) == 2
    damage(keys / "allowed" / "a")
    assert allow_list.refresh()
    assert (allow_list.get(one.public), allow_list.get(other.public)) == (None, other)


def test_a_folder_that_went_lets_nobody_in(keys):
    one = allow(keys, "a", KeyPair.generate().public, ROLES)
    allow_list = AllowList(keys)
    (keys / "allowed").rename(keys / "gone")
    assert allow_list.refresh()
    assert not allow_list.has_token(one.token)


@pytest.mark.parametrize("where", [
    "pathlib.Path.iterdir", "denseface.service.security._allow_list.read_private_text"])
def test_a_want_of_descriptors_revokes_nobody(keys, monkeypatch, where):
    one = allow(keys, "a", KeyPair.generate().public, ROLES)
    allow_list = AllowList(keys)

    def none_left(*_):
        error = OSError(errno.EMFILE, "Too many open files")
        raise (error if "iterdir" in where else KeyFileError("a")) from error

    with monkeypatch.context() as patched:
        patched.setattr(where, none_left)
        revoke(keys, "a")
        other = KeyPair.generate().public
        if "iterdir" not in where:
            monkeypatch.undo()
            other = allow(keys, "b", other, ROLES).public
            patched.setattr(where, none_left)
        assert not allow_list.refresh()
        assert allow_list.has_token(one.token)
    assert allow_list.refresh()
    assert not allow_list.has_token(one.token)
    assert (allow_list.get(other) is None) is ("iterdir" in where)


def test_the_commands(keys, capsys):
    def run(*arguments):
        status = main(["keys", *map(str, arguments), "--keys", str(keys)])
        return status, *capsys.readouterr()

    status, out, _ = run("new", "kiosk")
    public = read_public(keys / "kiosk.public")
    assert status == 0
    assert public in out
    assert read_pair(keys / "kiosk.secret").secret not in out
    assert run("allow", "front", keys / "kiosk.public", "presser", "subscriber")[0] == 0
    allow_list = AllowList(keys)
    listed = run("list")[1]
    assert listed.split() == ["front", allow_list.get(public).fingerprint, "presser,", "subscriber"]
    assert run("revoke", "front")[:2] == (0, "front may connect no more\n")
    assert run("list")[1] == ""
    status, _, error = run("revoke", "front")
    assert (status, len(error.splitlines())) == (2, 1)
    status, _, error = run("allow", "x", keys / "none.public", "worker")
    assert (status, len(error.splitlines())) == (2, 1)


def tick(keys):
    """Wait until the file system's clock has gone on, which it may do a hundred times a second."""
    changed, probe = (keys / "allowed").stat().st_mtime_ns, keys / "probe"
    until(lambda: probe.touch() or probe.stat().st_mtime_ns > changed)


def test_a_message_costs_one_look_however_many_keys_are_allowed(keys, monkeypatch):
    for number in range(20):
        allow(keys, f"key-{number}", KeyPair.generate().public, frozenset({Role.WORKER}))
    found = AllowList(keys)
    looks = []
    stat = Path.stat
    monkeypatch.setattr(Path, "stat", lambda path, **how: looks.append(path) or stat(path, **how))
    assert not found.refresh_if_touched()
    assert len(looks) == 1
    tick(keys)
    revoke(keys, "key-7")
    assert found.refresh_if_touched()
    tick(keys)
    allow(keys, "key-8", next(one.public for one in found if one.name == "key-8"),
          frozenset({Role.SENSOR}))
    assert found.refresh_if_touched()
    assert (len(found), found.changes) == (19, 2)
