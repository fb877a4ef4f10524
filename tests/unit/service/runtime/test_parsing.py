"""Durations and times as people write them."""

from datetime import UTC, datetime

import pytest

from denseface.service.errors import SettingsError
from denseface.service.runtime.parsing import parse_time
from denseface.service.settings import ServiceSettings


@pytest.mark.parametrize(("given", "seconds"), [
    ("24h", 86400), ("90m", 5400), ("7d", 604800), ("30", 30), ("1.5 h", 5400), ("off", None),
    ("OFF", None)])
def test_a_retention_is_read(given, seconds):
    assert ServiceSettings.of({"DENSEFACE_RETENTION": given}).retention == seconds


def test_without_a_word_it_is_a_day():
    assert ServiceSettings.of({}).retention == 86400


@pytest.mark.parametrize("given", ["0", "0h", "-1h", "soon", "1y", "nan", "1e9", "h"])
def test_another_retention_is_refused(given):
    with pytest.raises(SettingsError, match=r"DENSEFACE_RETENTION.*24h.*or off"):
        ServiceSettings.of({"DENSEFACE_RETENTION": given})
    with pytest.raises(SettingsError, match="--retention"):
        ServiceSettings.of({}, retention=given)


def test_a_time_without_a_zone_is_utc():
    assert parse_time("2026-01-31T14:30") == datetime(2026, 1, 31, 14, 30, tzinfo=UTC)
    assert parse_time("2026-01-31T14:30+02:00") == datetime(2026, 1, 31, 12, 30, tzinfo=UTC)
    with pytest.raises(ValueError, match="'yesterday': expected a time"):
        parse_time("yesterday")
