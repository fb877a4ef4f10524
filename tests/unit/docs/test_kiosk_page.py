"""docs/kiosk.md says all that a page of one's own has to know, and flags that there are."""

import re
from pathlib import Path
from typing import get_args

import pytest

from denseface.service.kiosk import page_messages
from denseface.service.kiosk.page_messages import FromPage, Hello, Screen, ScreenName, Trouble
from denseface.service.kiosk.settings import KioskSettings

_PAGE = (Path(__file__).resolve().parents[3] / "docs" / "kiosk.md").read_text()
_PROTOCOL = _PAGE.partition("## A page of your own")[2]
_SAID = [kind.model_fields["kind"].default for kind in (*get_args(FromPage), Hello, Screen)]


@pytest.mark.parametrize("word", [*_SAID, *ScreenName, *Trouble])
def test_everything_that_is_said_is_explained(word):
    assert f"`{word}`" in _PROTOCOL or f'"{word}"' in _PROTOCOL


def test_it_names_the_bytes_that_tell_pictures_from_faces():
    assert f"({page_messages.MIRROR}: mirror, {page_messages.FACE}: face)" in _PROTOCOL


def test_every_flag_that_is_named_exists():
    named = set(re.findall(r"--kiosk-([a-z-]+)", _PAGE))
    assert len(named) > 10
    assert named <= {name.replace("_", "-") for name in KioskSettings.model_fields}
