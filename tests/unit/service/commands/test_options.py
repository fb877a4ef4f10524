"""Flags that several commands share."""

import argparse
from dataclasses import replace

import pytest

from denseface.recon import Preset, Settings
from denseface.service.commands import _options
from denseface.service.export import FORMATS
from tests.unit.service.faces import small_face


def test_flags_are_given_again_to_a_child_as_they_were_given():
    parser = argparse.ArgumentParser()
    parser.add_argument("--debug", action="store_true")
    _options.add_hub(parser)
    given = ["--debug", "--listen=tcp://[::1]:5", "--listen=tcp://[::1]:7", "--set=ratio=9",
             "--log=text"]
    names = ("debug", "listen", "key", "preset", "set", "log")
    assert _options.repeated(parser.parse_args(given), *names) == given
    assert _options.repeated(parser.parse_args([]), *names) == ["--log=text"]


def test_what_a_report_doubts_is_one_line_each_on_stderr(capsys):
    face = small_face()
    report = face.report.model_copy(update={"warnings": ("depth lies\n", "12 ms apart")})
    _options.warn(replace(face, report=report))
    captured = capsys.readouterr()
    assert captured.err == "warning: depth lies\\n\nwarning: 12 ms apart\n"
    assert captured.out == ""


def test_the_help_names_every_format():
    parser = argparse.ArgumentParser()
    _options.add_outputs(parser, "--save")
    assert all(ending in parser.format_help() for ending in FORMATS)


def test_the_help_names_every_preset_and_the_default():
    parser = argparse.ArgumentParser()
    _options.add_recon(parser)
    *presets, last = Preset
    default = Settings.model_fields["preset"].default
    text = " ".join(parser.format_help().split())
    assert f"--preset NAME {', '.join(presets)} or {last} (default: {default})" in text


@pytest.mark.parametrize("text", ["", "0", "-1", "1.5", "x"])
def test_a_count_is_a_whole_number_above_0(text):
    assert _options.count("12") == 12
    with pytest.raises(argparse.ArgumentTypeError, match="expected a whole number"):
        _options.count(text)


@pytest.mark.parametrize("text", ["", "0", "-1", "nan", "inf", "86401", "x"])
def test_seconds_are_above_0_and_no_more_than_a_day(text):
    assert _options.seconds("0.5") == 0.5
    with pytest.raises(argparse.ArgumentTypeError, match="expected seconds"):
        _options.seconds(text)
