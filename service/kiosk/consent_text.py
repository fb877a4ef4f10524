"""The operator's own words of consent."""

import json
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from denseface.files import read_bounded
from denseface.service.errors import SettingsError, first_error, reason_of
from denseface.service.kiosk.installed import LANGUAGES
from denseface.service.kiosk.language import Language
from denseface.service.kiosk.settings import KioskSettings

__all__ = ["ConsentText", "check_files", "load_consent_text"]

_MAX_BYTES = 256 * 1024
"""Of the file."""
_Paragraph = Annotated[str, Field(min_length=1, max_length=2000)]


class ConsentText(BaseModel):
    """What is in the file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    version: Annotated[str, Field(min_length=1, max_length=64)]
    """Stored with each capture: change it with the text."""
    text: Annotated[dict[Language, Annotated[tuple[_Paragraph, ...], Field(
        min_length=1, max_length=20)]], Field(min_length=1, max_length=64)]
    """Paragraphs by language."""


def load_consent_text(path: Path, languages: tuple[str, ...]) -> ConsentText:
    """Read the file.

    Parameters
    ----------
    languages : those that are offered: each has to have its words

    Raises
    ------
    SettingsError
        One line that names the file and what is wrong with it.
    """
    try:
        given = json.loads(read_bounded(path, _MAX_BYTES))
    except (OSError, ValueError) as error:
        raise SettingsError(f"--kiosk-consent-text: {path}: {reason_of(error)}") from error
    if not isinstance(given, dict):
        raise SettingsError(
            f"--kiosk-consent-text: {path}: expected an object with version and text")
    try:
        found = ConsentText.model_validate(given)
    except ValidationError as error:
        field, message = first_error(error)
        raise SettingsError(f"--kiosk-consent-text: {path}: {field}: {message}") from error
    if missing := [language for language in languages if language not in found.text]:
        raise SettingsError(f"--kiosk-consent-text: {path}: text: has no words in {missing[0]}, "
                            "which --kiosk-languages offers")
    return found


def check_files(settings: KioskSettings) -> None:
    """Raise at once what the kiosk would raise later of the files that are named: SettingsError."""
    settings.tls()
    settings.lan_tls()
    if settings.folder.exists() and not settings.folder.is_dir():
        raise SettingsError(f"--kiosk-folder: {settings.folder}: is a file, expected a folder")
    known = sorted(one.stem for one in LANGUAGES.glob("*.json"))
    if unknown := [one for one in settings.languages if one not in known]:
        raise SettingsError(
            f"--kiosk-languages: expected some of {', '.join(known)}, found {unknown[0]!r}")
    if settings.consent_text is not None:
        load_consent_text(settings.consent_text, settings.languages)
