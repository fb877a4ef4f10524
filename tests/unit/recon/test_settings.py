"""Presets, what is given beside them, and what is refused."""

import pytest
from pydantic import ValidationError

from denseface.recon.errors import ImpossibleSettingsError
from denseface.recon.settings import Changes, Neighbors, Preset, Settings


def test_best_is_the_default():
    assert Settings() == Settings(preset=Preset.BEST) == Settings.of("best")
    assert Settings().r0_factor is None
    assert Settings().smoothing is None
    assert Settings().detail_factor == 1.0
    assert Settings().symmetry
    assert Settings().shading
    assert Settings().prior
    assert Settings().neighbors is Neighbors.LATTICE


@pytest.mark.parametrize("preset", [Preset.PAPER, Preset.FAITHFUL])
def test_the_papers_presets_have_its_r0_and_its_trees(preset):
    settings = Settings.of(preset)
    assert settings.preset is preset
    assert settings.r0_factor == 6
    assert settings.neighbors is Neighbors.RANDOMIZED
    assert settings.detail_factor is None
    assert not settings.symmetry
    assert not settings.shading
    assert not settings.prior
    assert settings.ratio == 10


def test_light_is_best_with_larger_pixels():
    light = Settings.of("light")
    assert light.pixel_mm == 3
    assert Settings().pixel_mm is None
    assert light == Settings.of("light", **Settings().model_dump(exclude={
        "preset", "pixel_mm", "detail_factor", "prior"}))


def test_presets_differ_in_smoothing():
    assert Settings.of("paper").smoothing < Settings.of("faithful").smoothing


def test_a_report_of_an_older_face_may_name_a_setting_that_is_gone():
    assert Settings.model_validate({"depth_offset_mm": 0.5}) == Settings()


@pytest.mark.parametrize("preset", list(Preset))
def test_every_setting_of_a_preset_is_in_range(preset):
    settings = Settings.of(preset)
    assert Settings.model_validate(settings.model_dump()) == settings
    assert settings.r0_factor is None or settings.r0_factor >= 2
    assert settings.smoothing is None or settings.smoothing >= 0.05


def test_what_is_given_wins():
    settings = Settings.of("paper", r0_factor=9, ratio=5)
    assert (settings.r0_factor, settings.ratio) == (9, 5)
    assert settings.smoothing == Settings.of("paper").smoothing
    assert Settings(detail_factor=None).detail_factor is None
    assert Settings.of("paper", smoothing="measured").smoothing is None
    assert Settings(preset="faithful", neighbors="exact").neighbors is Neighbors.EXACT


@pytest.mark.parametrize("settings", [Settings(), Settings.of("paper", smoothing=2),
                                      Settings(detail_factor=None)])
def test_json_and_back(settings):
    assert Settings.model_validate_json(settings.model_dump_json()) == settings


def test_equal_settings_are_one_key():
    assert hash(Settings()) == hash(Settings.of("best"))
    assert len({Settings(), Settings.of("paper"), Settings(preset="paper")}) == 2


def test_settings_do_not_change():
    with pytest.raises(ValidationError, match="frozen"):
        Settings().ratio = 3


@pytest.mark.parametrize(("given", "name", "message"), [
    ({"preset": "fastest"}, "preset", "'paper', 'faithful', 'light' or 'best'"),
    ({"r0": 6}, "r0", "no such field, expected one of preset, r0_factor, "),
    ({"r0_factor": 1.9}, "r0_factor", "at least 2"),
    ({"r0_factor": 41}, "r0_factor", "at most 40"),
    ({"r0_factor": float("nan")}, "r0_factor", "at most 40"),
    ({"r0_factor": 0.0}, "r0_factor", "at least 2"),
    ({"smoothing": 0}, "smoothing", "0.05"),
    ({"smoothing": float("inf")}, "smoothing", "1000"),
    ({"detail_factor": 0.4}, "detail_factor", "0.5"),
    ({"detail_factor": 11}, "detail_factor", "10"),
    ({"neighbors": "guessed"}, "neighbors", "'randomized', 'exact' or 'lattice'"),
    ({"pixel_mm": 0.4}, "pixel_mm", "0.5"),
    ({"pixel_mm": 7}, "pixel_mm", "6"),
    ({"ratio": 0}, "ratio", "1"),
    ({"ratio": 1000}, "ratio", "100"),
    ({"ratio": "ten"}, "ratio", "a number"),
])
def test_what_is_wrong_is_named(given, name, message):
    with pytest.raises(ImpossibleSettingsError) as caught:
        Settings(**given)
    assert str(caught.value).startswith(f"{name}: ")
    assert message in str(caught.value)
    with pytest.raises(ValidationError):  # with its path, where it is a part of something
        Settings.model_validate(given)


def test_a_list_is_no_settings():
    with pytest.raises(ValidationError, match="dictionary"):
        Settings.model_validate([1, 2])


@pytest.mark.parametrize(("given", "line"), [
    ({"preset": "fast"}, "preset: expected 'paper', 'faithful', 'light' or 'best', found 'fast'"),
    ({"preset": None}, "preset: expected 'paper', 'faithful', 'light' or 'best', found None"),
    ({"smooting": 3}, "smooting: no such field, expected one of preset, r0_factor, smoothing, "
                      "detail_factor, symmetry, shading, prior, neighbors, pixel_mm, ratio"),
    ({"ratio": 1e9}, "ratio: expected at most 100, found 1000000000.0"),
    ({"preset": "paper", "neighbors": [1]},
     "neighbors: expected 'randomized', 'exact' or 'lattice', found [1]"),
])
def test_a_wrong_change_is_one_line(given, line):
    with pytest.raises(ImpossibleSettingsError) as caught:
        Settings.of(**given)
    assert str(caught.value) == line


def test_type_checkers_know_the_names_that_can_be_changed():
    assert Changes.__annotations__.keys() == Settings.model_fields.keys() - {"preset"}
