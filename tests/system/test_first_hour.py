"""The first hour and the tutorial are typed as their readers would, and print what they show."""

from itertools import chain

import pytest

from tests.system.consoles import matches, run_consoles, typed_in
from tests.system.running import REPOSITORY
from tests.system.snippets import CONSOLES, reader, snippets
from tests.virtual_sensor.process import environment
from tests.waiting import PATIENCE

_KIOSK = {"DENSEFACE_KIOSK": "on", "DENSEFACE_KIOSK_ADDRESS": "0"}
"""Any free port."""


@pytest.mark.timeout(420)
@pytest.mark.parametrize("page", CONSOLES)
def test_what_is_typed_prints_what_the_page_shows(page):
    blocks = snippets(REPOSITORY / page)
    with reader(REPOSITORY, environment()) as (desk, variables):
        for block in blocks:
            if block.file:
                (desk / block.file).write_text(block.text)
        commands = chain.from_iterable(
            typed_in(block.text, block.line + 1) for block in blocks
            if block.language == "console" and not block.reason)
        # The page removes what is there in the end: it must not be the user's who tests.
        state = {"XDG_STATE_HOME": str(desk.parent / "state")}
        done = run_consoles(list(commands), desk, variables | _KIOSK | state, 200 * PATIENCE)
    other = [f"{page}:{one.line}: {one.command}\n{printed}" for one, printed in done
             if not matches(one.shown, printed)]
    assert not other, "\n".join(["printed otherwise than shown:", *other])


@pytest.mark.parametrize(("shown", "printed", "same"), [
    ("16,123 points, 0.5 mm\n", "9 points, 1,000.25 mm\n", True),
    ("16,123 points\n", "no points\n", False),
    ("de8b3bc9f2bd41f8a0d4c16f0ce11878\n", "00000000000000000000000000000abc\n", True),
    ("de8b3bc9f2bd41f8a0d4c16f0ce11878\n", "demo\n", False),
    ("a ... c\n", "a b b c\n", True), ("a ... c\n", "a b\nc\n", False),
    ("...\nlast\n", "one\ntwo\nlast\n", True), ("...\nlast\n", "last\n", True),
    ("", "something\n", False), ("now  0\n", "now      12\n", True), ("(a|b)\n", "a\n", False)])
def test_what_is_shown_and_what_is_printed_are_compared_by_a_simple_rule(shown, printed, same):
    assert matches(shown, printed) == same
