"""Links over a restart of the kiosk."""

import os

import pytest

from denseface.service.errors import CorruptFileError, StoreError
from denseface.service.kiosk.links.kept_links import KeptLinks
from denseface.service.kiosk.links.link_file import LinkFile
from denseface.service.kiosk.links.link_store import GoneLinkError, LinkRecords, UnknownLinkError


def kept(path, clock=lambda: 100.0) -> KeptLinks:
    return KeptLinks(LinkFile(path), uses=2, lifetime_s=60.0, clock=clock)


async def _life(path):
    links = kept(path)
    token, _ = await links.make("capture-1", "fr")
    gone, _ = await links.make("capture-2", "en")
    await links.finish(links.begin(token).digest, complete=True)
    await links.forget("capture-2")
    return token, gone


def test_a_restart_keeps_uses_and_ends_and_the_file_is_the_user_s_alone(tmp_path, run):
    path = tmp_path / "links.json"
    token, gone = run(_life(path))
    assert path.stat().st_mode & 0o777 == 0o600
    again = kept(path)
    assert again.find(token).uses_left == 1
    assert again.find(token).language == "fr"
    with pytest.raises(GoneLinkError):
        again.find(gone)
    text = path.read_text()
    assert "capture-2" not in text
    assert token not in text


def test_a_file_that_is_none_is_said_and_links_go_on(tmp_path, run, capsys):
    path = tmp_path / "links.json"
    for text in ("", "{", '{"links": [{"digest": "0"}]}', '{"version": 2}', "[" * 10_000):
        path.write_text(text)
        with pytest.raises(CorruptFileError, match=r"links\.json"):
            LinkFile(path).read()
    links = kept(path)
    with pytest.raises(UnknownLinkError):
        links.find("x")
    token, _ = run(links.make("capture-1", "en"))
    assert kept(path).find(token)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(StoreError, match="regular"):
        LinkFile(path).read()
    path.unlink()
    assert LinkFile(path).read() == LinkRecords()


def test_a_disk_that_refuses_leaves_links_good_but_a_withdrawal_is_said_to_be_open(tmp_path, run):
    path = tmp_path / "folder" / "links.json"
    path.parent.touch()
    links = kept(path)

    async def life():
        token, _ = await links.make("capture-1", "en")
        assert links.find(token)
        with pytest.raises(StoreError, match="expected a folder"):
            await links.forget("capture-1")
        with pytest.raises(GoneLinkError):
            links.find(token)
        path.parent.unlink()
        path.parent.mkdir()
        await links.tidy()  # as happens from time to time
        assert "capture-1" not in path.read_text()
        await links.forget("capture-1")

    run(life())


def test_what_has_expired_leaves_the_file_by_itself(tmp_path, run):
    now = [100.0]
    path = tmp_path / "links.json"
    links = kept(path, lambda: now[0])

    async def life():
        await links.make("capture-1", "en")
        assert "capture-1" in path.read_text()
        now[0] = 160.0
        await links.tidy()

    run(life())
    assert "capture-1" not in path.read_text()
