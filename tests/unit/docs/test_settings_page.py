"""docs/settings.md says of each setting what `Settings` says, for every preset."""

import re
from pathlib import Path

import pytest

from denseface import Preset, Settings
from denseface.recon.settings import Neighbors
from denseface.service.commands._options import SETTINGS

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "settings.md").read_text()
ROWS = {cells[0].strip("`"): cells[1:] for cells in (
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.splitlines() if line.startswith("| `"))}
HEAD = re.findall(r"`(\w+)`", next(line for line in PAGE.splitlines() if line.startswith("| name")))


def bounds(name):
    """Give least and most of a number, from the schema that pydantic validates by."""
    schema = Settings.model_json_schema()["properties"][name]
    number = next((one for one in schema.get("anyOf", [schema]) if "minimum" in one), None)
    return number and (number["minimum"], number["maximum"])


def test_each_setting_has_its_row_and_its_name_in_the_help():
    assert tuple(ROWS) == SETTINGS == tuple(Settings.model_fields)[1:]


def test_each_preset_has_its_column():
    assert [preset.value for preset in reversed(Preset)] == HEAD


@pytest.mark.parametrize("name", SETTINGS)
def test_values_and_defaults_are_those_of_the_code(name):
    values, *defaults, words = ROWS[name]
    assert len(words) > 20
    if limits := bounds(name):
        assert values.startswith("{:g} to {:g}".format(*limits))
        missing = values.endswith((", or none", ", or measured"))
        assert missing == (Settings.model_fields[name].default is None)
    else:
        choices = list(Neighbors) if name == "neighbors" else ["true", "false"]
        assert sorted(values.split(", ")) == sorted(choices)
    for preset, said in zip(HEAD, defaults, strict=True):
        assert Settings.of(preset) == Settings.of(preset, **{name: said}), f"{name} of {preset}"
