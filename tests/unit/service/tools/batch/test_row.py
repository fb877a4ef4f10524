"""Rows of an archive's summary: what comes from elsewhere is checked, whatever an error says."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from denseface.service.errors import FormatError
from denseface.service.tools.batch.row import (
    MAX_THUMBNAIL_BYTES,
    MAX_WARNINGS,
    MAX_WHY,
    STATES,
    Row,
)

FACE = {"source": "a.oni", "frame": 3, "state": "face", "output": "a_0003.npz", "measured": 7000,
        "dense": 148_000, "sigma_mm": 0.5, "mean_spacing_mm": 1.2, "noise_mm": 1.0,
        "face_score": 0.9, "seconds": 0.1, "worker": "w1", "attempts": 1, "warnings": ("dark",),
        "thumbnail": b"\xff\xd8\xff"}


def test_a_row_goes_to_a_dict_and_back():
    row = Row.from_dict(FACE)
    assert Row.from_dict(row.as_dict()) == row
    assert row.as_dict() == FACE | {"error": "", "why": ""}
    assert row.key == ("a.oni", 3)


@pytest.mark.parametrize(("field", "value"), [
    ("source", ""), ("source", "a" * 5000), ("source", 3), ("source", None), ("frame", -1),
    ("frame", 2**31), ("frame", "3"), ("frame", True), ("frame", 1.0), ("state", "dead"),
    ("output", "/etc/passwd"), ("output", "../a.npz"), ("output", "a/../../b"), ("output", ""),
    ("error", "no such\nclass"), ("error", "<script>"), ("why", "none"), ("why", 3),
    ("measured", -1), ("dense", 1.5), ("sigma_mm", float("nan")), ("sigma_mm", -1.0),
    ("noise_mm", float("inf")), ("face_score", 1.5), ("seconds", None), ("attempts", -1),
    ("warnings", "dark"), ("warnings", [3]), ("thumbnail", "text"), ("thumbnail", b"<svg/>"),
    ("thumbnail", b"\xff\xd8\xff" + bytes(MAX_THUMBNAIL_BYTES)), ("more", 1),
])
def test_what_is_no_row_is_one_line_that_names_the_field(field, value):
    with pytest.raises(FormatError) as error:
        Row.from_dict(FACE | {field: value})
    assert "\n" not in str(error.value)
    assert field in str(error.value) or field == "why"


@pytest.mark.parametrize("given", [None, [], "row", {}, {3: 4}, {"source": "a"}])
def test_what_is_no_dict_of_fields_is_no_row(given):
    with pytest.raises(FormatError):
        Row.from_dict(given)


@pytest.mark.parametrize("state", [state for state in STATES if state != "face"])
def test_a_frame_without_a_face_has_a_reason(state):
    without = {"source": "a.oni", "frame": None, "state": state}
    with pytest.raises(FormatError, match="expected a reason"):
        Row.from_dict(without)
    assert Row.from_dict(without | {"why": "nobody"}).why == "nobody"
    assert Row.from_dict(without | {"error": "OSError"}).error == "OSError"


@given(st.text(), st.lists(st.text(), max_size=MAX_WARNINGS + 5), st.text(min_size=1))
def test_whatever_an_error_says_becomes_one_line_of_valid_text(why, warnings, source):
    row = Row(source=source, frame=0, state="failed", error="OSError", why=why * 100,
              warnings=warnings)
    assert len(row.why) <= MAX_WHY
    assert len(row.warnings) == min(len(warnings), MAX_WARNINGS)
    for text in (row.why, row.source, *row.warnings):
        assert json.loads(json.dumps(text).encode()) == text
        text.encode()
    assert "\n" not in row.why
    assert Row.from_dict(row.as_dict()) == row
