"""What the help says: each flag has its words, each command an example that can be typed."""

import argparse
import shlex
from collections.abc import Iterator

import pytest

from denseface.service.cli import _examples, _parser, main
from denseface.service.commands import COMMANDS


def parsers(parser: _parser._Parser) -> Iterator[_parser._Parser]:
    yield parser
    parser.complete()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                yield from parsers(one)


ALL = {one.prog.removeprefix("denseface").strip(): one for one in parsers(_parser._parser())}


@pytest.mark.parametrize("name", ALL)
def test_every_flag_and_word_is_explained(name):
    unexplained = [action.option_strings or action.dest for action in ALL[name]._actions
                   if not action.help and not isinstance(action, argparse._SubParsersAction)]
    assert unexplained == []


@pytest.mark.parametrize("name", sorted({*ALL} - {""}))
def test_every_help_ends_in_an_example_that_is_read_as_it_stands(name):
    assert (example := _examples.EXAMPLES[name]).startswith(name)
    assert ALL[name].format_help().endswith(f"example:\n  denseface {example}\n")
    if name != "help":
        assert _parser.parse(shlex.split(example)).command == name.split()[0]


def test_what_people_do_first_is_read_as_it_stands():
    lines = _examples.FIRST.split("\n")[1:]
    assert len(lines) == 4
    for line in lines:
        words = shlex.split(line.split("   ")[0])
        assert words.pop(0) == "denseface"
        assert _parser.parse(words).command in COMMANDS


@pytest.mark.parametrize(("arguments", "shown"), [
    ([], "denseface [-h]"), (["-h"], "denseface [-h]"), (["help"], "denseface [-h]"),
    (["help", "press"], "denseface press [-h]"), (["press", "-h"], "denseface press [-h]"),
    (["help", "keys", "allow"], "denseface keys allow [-h]"),
])
def test_help_is_shown_however_it_is_asked_for(arguments, shown, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert not ended.value.code
    assert capsys.readouterr().out.startswith(f"usage: {shown}")


def test_the_exit_statuses_are_in_the_help(capsys):
    with pytest.raises(SystemExit):
        main([])
    assert "130 and 143" in capsys.readouterr().out
