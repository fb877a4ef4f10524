"""Which modes of a sensor are asked for."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from denseface.capture.modes import COLOR_FORMATS, DEPTH_FORMATS, Mode, listed, rank


def depth(width=640, height=480, fps=30, pixel_format="DEPTH_1_MM"):
    return Mode(width, height, fps, pixel_format)


def color(width=640, height=480, fps=30, pixel_format="RGB888"):
    return Mode(width, height, fps, pixel_format)


VGA = depth(), color()
XTION = ([depth(320, 240, 30), depth(320, 240, 60), depth(),
          depth(pixel_format="DEPTH_100_UM"), depth(pixel_format="SHIFT_9_2")],
         [color(320, 240, 30, "YUV422"), color(320, 240, 60), color(pixel_format="YUYV"),
          color(pixel_format="YUV422"), color(), color(1280, 1024)])


@pytest.mark.parametrize(("offered", "best"), [
    (XTION, VGA),
    (([depth()], [color(), color(fps=60)]), VGA),
    # Half the frames of a faster stream would have no partner.
    (([depth(), depth(320, 240, 15)], [color(1280, 1024, 15)]),
     (depth(320, 240, 15), color(1280, 1024, 15))),
    (([depth(), depth(fps=15)], [color(fps=15)]), (depth(fps=15), color(fps=15))),
    (([depth(320, 240, 60), depth(320, 240)], [color(320, 240, 60), color(320, 240)]),
     (depth(320, 240), color(320, 240))),
    (([depth(640, 400), depth(320, 240)], [color()]), (depth(640, 400), color())),
    (([depth(320, 240)], [color()]), (depth(320, 240), color())),
    (([depth()], [color(1280, 1024)]), (depth(), color(1280, 1024))),
    (([depth()], [color(320, 240), color(1280, 1024)]), (depth(), color(1280, 1024))),
    (([depth()], [color(320, 240), color(pixel_format="YUYV")]),
     (depth(), color(pixel_format="YUYV"))),
    (([depth()], [color(pixel_format="YUYV"), color(pixel_format="YUV422")]),
     (depth(), color(pixel_format="YUV422"))),
    (([depth(pixel_format="DEPTH_100_UM")], [color()]),
     (depth(pixel_format="DEPTH_100_UM"), color())),
    (([depth(fps=10), depth(fps=60)], [color(fps=10), color(fps=60)]),
     (depth(fps=60), color(fps=60))),
    (([depth(fps=30)], [color(fps=15), color(fps=25)]), (depth(), color(fps=25))),
    (([depth(320, 240), depth()], None), (depth(), None)),
    (([depth(160, 120), depth(512, 384)], None), (depth(512, 384), None)),
])
def test_the_best_pair(offered, best):
    assert rank(*offered)[0] == best


def test_all_that_can_be_read_are_given_once():
    pairs = rank(XTION[0] + XTION[0], XTION[1])
    assert len(pairs) == len(set(pairs)) == 4 * 6


@pytest.mark.parametrize("mode", [
    depth(pixel_format="SHIFT_9_2"), depth(0, 480), depth(640, -1), depth(99_999, 480),
    depth(fps=0)])
def test_nothing_that_can_be_read(mode):
    assert rank([mode], [color()]) == []
    assert rank([mode], None) == []
    assert rank([depth()], [color(641, pixel_format="YUYV"), color(pixel_format="JPEG")]) == []


MODES = st.builds(Mode, st.sampled_from([160, 320, 640, 1280]), st.sampled_from([240, 400, 480]),
                  st.integers(1, 90), st.sampled_from((*DEPTH_FORMATS, *COLOR_FORMATS, "GRAY8")))


@given(st.lists(MODES, max_size=6), st.none() | st.lists(MODES, max_size=6), st.randoms())
def test_the_order_offered_does_not_matter(depths, colors, random):
    first = rank(depths, colors)
    random.shuffle(depths)
    assert rank(depths, colors) == first


def test_a_message_names_what_is_offered():
    assert listed([depth(), depth(fps=15), color(1280, 1024, 10, "YUYV")]) == (
        "640x480 DEPTH_1_MM at 15/30/s; 1280x1024 YUYV at 10/s")
    assert listed([]) == "nothing"
