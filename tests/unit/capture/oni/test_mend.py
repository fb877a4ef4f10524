import os
import tempfile
from contextlib import suppress

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from denseface.capture.errors import UnreadableSourceError
from denseface.capture.oni.file import read_oni
from denseface.capture.oni.mend import mended, what_is_missing
from denseface.capture.oni.records import HEADER
from tests.system.running import RECORDINGS

SMALL = RECORDINGS / "empty_room.oni"


@pytest.fixture(scope="module")
def content():
    return SMALL.read_bytes()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "take.oni"


def copied(path) -> bytes:
    with mended(path, read_oni(path)) as copy:
        copy.seek(0)
        return copy.read()


def test_nothing_is_missing_of_a_whole_file():
    assert what_is_missing(read_oni(SMALL)) is None


@pytest.mark.parametrize("number", [0, 1, 65, 2**32 - 1])
def test_a_header_that_has_another_number_of_streams(content, path, number):
    """As while it is recorded, and as no sensor has."""
    *rest, _ = HEADER.unpack_from(content)
    path.write_bytes(HEADER.pack(*rest, number) + content[HEADER.size:])
    assert what_is_missing(read_oni(path)) == "the number of streams in its header"
    path.write_bytes(copied(path))
    assert what_is_missing(read_oni(path)) is None


def test_a_copy_holds_the_same_frames(content, path):
    path.write_bytes(content[:-2000])
    before = read_oni(path)
    path.write_bytes(copied(path))
    after = read_oni(path)
    assert (before.cut is None, after.cut) == (False, None)
    assert (before.order, before.stamps_us) == (after.order, after.stamps_us)
    assert what_is_missing(after) is None


def test_a_copy_is_gone_when_closed(content, path, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "t"))
    (tmp_path / "t").mkdir()
    path.write_bytes(content[:-2000])
    with mended(path, read_oni(path)) as copy:
        assert os.listdir(tmp_path / "t") == []  # noqa: PTH208
        assert copy.fileno() >= 0


@given(st.data())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_damage_gives_another_kind_of_error(content, path, data):
    changed = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        # Where the structure is: the beginning of the file.
        changed[data.draw(st.integers(0, 2500))] = data.draw(st.integers(0, 255))
    path.write_bytes(changed[:data.draw(st.integers(0, len(changed)))])
    with suppress(UnreadableSourceError):
        found = read_oni(path)
        if what_is_missing(found):
            copied(path)
