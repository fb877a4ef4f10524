"""The operator's own words of consent."""

import json

import pytest

from denseface.service.errors import SettingsError
from denseface.service.kiosk.consent_text import load_consent_text
from denseface.service.kiosk.process import visit_options
from denseface.service.kiosk.settings import KioskSettings

WORDS = {"version": "museum-1", "text": {"en": ["One.", "Two."], "de": ["Eins."]}}


def test_its_words_are_shown_and_its_version_is_stored(tmp_path):
    path = tmp_path / "consent.json"
    path.write_text(json.dumps(WORDS))
    settings = KioskSettings.of({}, consent_text=path, languages="en,de", idle_s="20")
    options = visit_options(settings)
    assert (options.text_version, options.position_s) == ("museum-1", 20)
    assert options.text == {"en": ("One.", "Two."), "de": ("Eins.",)}


@pytest.mark.parametrize(("text", "message"), [
    ("{", "Expecting property name"),
    ("[]", "json: expected an object with version and text$"),
    (json.dumps(WORDS | {"more": 1}), "more: Extra inputs"),
    (json.dumps(WORDS | {"version": ""}), "version: "),
    (json.dumps(WORDS | {"text": {"en": []}}), "text.en: "),
    (json.dumps(WORDS | {"text": {"English": ["x"]}}), "text.English"),
    (json.dumps(WORDS | {"text": {"en": ["x"]}}), "has no words in de"),
    ("x" * 300_000, "Has more than")])
def test_what_is_wrong_with_the_file_is_named_in_one_line(text, message, tmp_path):
    path = tmp_path / "consent.json"
    path.write_text(text)
    with pytest.raises(SettingsError, match=message) as raised:
        load_consent_text(path, ("en", "de"))
    assert str(raised.value).startswith(f"--kiosk-consent-text: {path}: ")
    assert len(str(raised.value).splitlines()) == 1
