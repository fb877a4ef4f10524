"""Who pressed what."""

from service.pressed import Pressed


def test_the_first_to_press_an_id_has_it():
    pressed = Pressed()
    pressed.note("a", "one", anew=True)
    pressed.note("a", "two", anew=False)
    assert pressed.by("a", "one")
    assert not pressed.by("a", "two")


def test_an_id_that_was_removed_is_whoever_s_presses_it_next():
    pressed = Pressed()
    pressed.note("a", "one", anew=True)
    pressed.note("a", "two", anew=True)
    assert pressed.by("a", "two")
    assert not pressed.by("a", "one")


def test_old_ones_are_forgotten(monkeypatch):
    monkeypatch.setattr("service.pressed._MOST", 2)
    pressed = Pressed()
    for name in "abc":
        pressed.note(name, "one", anew=True)
    assert [pressed.by(name, "one") for name in "abc"] == [False, True, True]
