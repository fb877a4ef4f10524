"""Flags and commands of the command line, what is said of a wrong one, and the help."""

import argparse
import itertools
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from difflib import get_close_matches
from functools import partial
from typing import Any, NoReturn

from denseface.service.cli._examples import EXAMPLES, EXIT_STATUSES, FIRST
from denseface.service.commands import COMMANDS, load
from denseface.service.runtime.terminal import complain, say

__all__ = ["USAGE", "parse"]

USAGE = 2
"""Exit status of wrong usage."""


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the arguments of a process, or these; exits where they are wrong or ask for help."""
    parser = _parser()
    args = parser.parse_args(arguments)
    if args.version:
        say(*_versions(everything=args.verbose), flush=True)
        parser.exit()
    if args.command is None:
        parser.print_help()
        parser.exit()
    if args.command == "help":
        parser.parse_args([*args.words, "--help"])
    args.whole_parser = _whole_parser  # for what tells a shell of all flags
    return args


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Shows commands as it shows flags: no line for what stands for them, names in one column."""

    def add_argument(self, action: argparse.Action) -> None:
        super().add_argument(action)
        if isinstance(action, argparse._SubParsersAction):
            self._action_max_length += self._indent_increment  # argparse forgets it

    def _format_action(self, action: argparse.Action) -> str:
        text = super()._format_action(action)
        if isinstance(action, argparse._SubParsersAction):
            return text.partition("\n")[2]
        return text


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, by the help of the very command that was meant."""

    declare: Callable[[argparse.ArgumentParser], None] = staticmethod(lambda _: None)
    """Adds the flags of a command."""

    def __init__(self, **given: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=_Formatter, **given)
        if self.epilog is None:
            self.epilog = _example(self.prog)

    def complete(self) -> None:
        """Add the flags, where that is not done: of the command alone that is run."""
        declare, self.declare = self.declare, _Parser.declare
        declare(self)

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None,
    ) -> tuple[argparse.Namespace, list[str]]:
        """Refuse here what is unknown, not where the outermost parser finds it left over."""
        self.complete()
        given = sys.argv[1:] if args is None else list(args)
        if self._subparsers is None:  # else it may be a flag of one of them
            # First: what is said to be missing may well be what was meant.
            for one in itertools.takewhile("--".__ne__, given):
                if re.fullmatch("--[^ =]+(=.*)?", one) and (
                        one.partition("=")[0] not in self._option_string_actions):
                    self.error(self._unknown(one))
        parsed, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(self._unknown(unknown[0]))
        return parsed, []

    def _print_message(self, message: str, file: Any = None) -> None:  # noqa: ARG002
        # argparse leaves out what cannot be written.
        say(*message.rstrip("\n").split("\n"), flush=True)

    def error(self, message: str) -> NoReturn:
        message = message.removeprefix("argument ").replace(
            "expected one argument", "expected a value; one that begins with - goes after a =")
        complain(f"{self.prog}: {message} (see {self.prog} --help)")
        self.exit(USAGE)

    def _unknown(self, argument: str) -> str:
        if not argument.startswith("-"):
            return f"{argument!r}: expected nothing more"
        flag = argument.partition("=")[0]
        return f"unknown flag {flag}{_suggestion(flag, self._option_string_actions)}"

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        if not arg_string and not isinstance(action, argparse._SubParsersAction):
            # As of a shell's variable that is not set.
            expected = (_listed(action.choices) if action.choices else
                        action.metavar if action.option_strings else "a word")
            raise argparse.ArgumentError(action, f"expected {expected}, found ''")
        return super()._get_value(action, arg_string)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        if isinstance(action, argparse._SubParsersAction):
            suggestion = _suggestion(str(value), action.choices)
            known = "" if suggestion else f", expected {_listed(action.choices)}"
            raise argparse.ArgumentError(None, f"unknown command {str(value)!r}{suggestion}{known}")
        raise argparse.ArgumentError(
            action, f"expected {_listed(action.choices)}, found {str(value)!r}")


def _parser() -> _Parser:
    parser = _Parser(
        prog="denseface", description="One press, one depth frame, one dense coloured 3D face.",
        epilog=f"{FIRST}\n\n{EXIT_STATUSES}")
    parser.add_argument("--version", action="store_true", help="show the version and exit")
    parser.add_argument("--verbose", action="store_true",
                        help="with --version: show those of Python, the system and packages, too")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, text in COMMANDS.items():
        command = commands.add_parser(
            name, help=text, description=text[0].upper() + text[1:] + ".")
        command.add_argument(
            "--debug", action="store_true", help="show a traceback where something goes wrong")
        command.declare = partial(_declare, name)
    helping = commands.add_parser("help", help="show the help of a command")
    helping.add_argument("words", nargs="*", metavar="COMMAND",
                         help="the command; of one with commands of its own, such as keys, also "
                              "that (default: all commands)")
    return parser


def _declare(name: str, parser: argparse.ArgumentParser) -> None:
    load(name).add_arguments(parser)


def _whole_parser() -> argparse.ArgumentParser:
    """Give the parser with the flags of all commands, which `parse` declares when they are run."""
    def complete(parser: argparse.ArgumentParser) -> None:
        if isinstance(parser, _Parser):
            parser.complete()
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for one in action.choices.values():
                    complete(one)

    parser = _parser()
    complete(parser)
    return parser


def _versions(*, everything: bool) -> Iterator[str]:
    """Give this version; also those of all that it rests on, as a report of a fault needs them."""
    from denseface.version import VERSION

    yield VERSION
    if not everything:
        return
    import platform
    from importlib.metadata import PackageNotFoundError, version

    from denseface.missing import BASE, EXTRAS

    yield f"Python {platform.python_version()} ({sys.executable})"
    yield platform.platform()
    for package in sorted({*BASE, "open3d-cpu", *(package for package, _ in EXTRAS.values())}):
        with suppress(PackageNotFoundError):
            yield f"{package} {version(package)}"


def _example(prog: str) -> str | None:
    example = EXAMPLES.get(prog.removeprefix("denseface "))
    return f"example:\n  denseface {example}" if example else None


def _suggestion(given: str, known: Iterable[str]) -> str:
    near = get_close_matches(given, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""


def _listed(choices: Iterable[object]) -> str:
    *others, last = map(str, choices)
    return f"{', '.join(others)} or {last}" if others else last
