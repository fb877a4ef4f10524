"""Single frames out of a recording, one after the other."""

from dataclasses import replace

import pytest

from denseface.capture.errors import UnreadableSourceError
from denseface.capture.npz import save_frame
from denseface.service.errors import FrameTooLargeError, UsageError
from denseface.service.tools import frames as module
from denseface.service.tools.frames import FrameChoice, FrameReader, read_frame
from tests.unit.service.faces import small_frame

CHOICE = FrameChoice(10**6)
FRAMES = [replace(small_frame(n), depth_timestamp_us=n) for n in range(5)]


class Recording:
    """A source that can be gone through once, from its beginning."""

    frame_count = None

    def __init__(self, done):
        self.done = done

    def __iter__(self):
        for number, frame in enumerate(FRAMES):
            self.done.append(number)
            yield frame
        raise UnreadableSourceError("take.oni: cut off")

    def look_closely(self, *, refuse):
        self.done.append("look" if refuse else "")

    def close(self):
        self.done.append("close")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


@pytest.fixture
def done(monkeypatch):
    """Give what was done with the source: frames by their number, looks, ends."""
    done = []
    monkeypatch.setattr(module, "_opened", lambda *_: Recording(done))
    return done


def test_it_goes_on_from_where_it_is_and_looks_at_what_it_gives(done):
    reader = FrameReader("take.oni", CHOICE)
    assert reader.read(1).depth_timestamp_us == 1
    assert reader.read(2).depth_timestamp_us == 2
    assert reader.read(4).depth_timestamp_us == 4
    assert done == [0, "look", 1, "look", 2, 3, "look", 4]
    done.clear()
    assert reader.read(4).depth_timestamp_us == 4
    assert done[:2] == ["close", 0], "and back from the beginning"
    reader.close()
    reader.close()
    assert done[2:].count("close") == 1


@pytest.mark.parametrize("number", range(5))
def test_it_gives_what_is_read_alone(done, number):
    alone = read_frame("take.oni", number, CHOICE).frame
    looked = done[:-1]
    done.clear()
    assert FrameReader("take.oni", CHOICE).read(number) is alone
    assert done == looked


def test_after_an_error_it_begins_anew(done):
    reader = FrameReader("take.oni", CHOICE)
    with pytest.raises(UnreadableSourceError, match="cut off"):
        reader.read(5)
    assert reader.read(3).depth_timestamp_us == 3
    with pytest.raises(FrameTooLargeError):
        FrameReader("take.oni", FrameChoice(10)).read(0)


def test_of_a_folder_it_reads_what_is_asked_for_alone(tmp_path):
    for number in range(3):
        save_frame(FRAMES[number], tmp_path / f"{number}.npz")
    (tmp_path / "1.npz").write_bytes(b"damaged")
    reader = FrameReader(str(tmp_path), CHOICE)
    assert [reader.read(number).depth_timestamp_us for number in (2, 0, 2)] == [2, 0, 2]
    with pytest.raises(UsageError, match=r"has 3 frames \(0 to 2\), --frame asks for 3"):
        reader.read(3)
