"""All words that a visitor or an operator reads: one JSON file for each language."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from denseface.files import read_bounded
from denseface.service.errors import SettingsError, reason_of
from denseface.service.kiosk.installed import LANGUAGES

__all__ = ["Texts", "load_texts"]

_MAX_BYTES = 2**20
"""Of a file of one language."""


class Texts:
    """The words of one language, by key; a key that is missing is given in its place."""

    def __init__(self, language: str, words: Mapping[str, str]) -> None:
        self.language = language
        self._words = words
        self.direction = "rtl" if words.get("language.direction") == "rtl" else "ltr"

    def __getitem__(self, key: str) -> str:
        return self._words.get(key, key)


def load_texts(languages: Iterable[str], folder: Path = LANGUAGES) -> dict[str, Texts]:
    """Read languages by name.

    Raises
    ------
    SettingsError
        One line that names the file and what is wrong with it.
    """
    found = {}
    for language in languages:
        path = folder / f"{language}.json"
        try:
            words = json.loads(read_bounded(path, _MAX_BYTES))
        except (OSError, ValueError) as error:
            raise SettingsError(f"{path}: {reason_of(error)}") from error
        if not isinstance(words, dict) or not all(isinstance(one, str) for one in words.values()):
            raise SettingsError(f"{path}: expected an object of texts")
        found[language] = Texts(language, words)
    return found
