"""What pydantic refuses, in the words of this product: `expected ..., found ...`."""

from datetime import datetime
from pathlib import PurePath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

__all__ = ["CAPTURE_ID", "PEER_NAME", "TEXT_OF_PATTERN", "complaint"]

_SHOWN = 60
"""Characters of a wrong value that are shown."""
_EXPECTED = {
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "string_type": "a text",
    "string_too_short": "at least {min_length} characters",
    "string_too_long": "at most {max_length} characters",
    "model_type": "a {class_name}, or its fields by name",
    "dict_type": "an object",
    "list_type": "a list",
    "tuple_type": "a list",
    "timezone_aware": "a time with its zone",
    "literal_error": "{expected}",
    "enum": "{expected}",
}
"""Kind of error -> what was expected, with the error's own context."""
CAPTURE_ID = "^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
"""Pattern of a capture's id."""
PEER_NAME = "^[!-~]{1,100}$"
"""Pattern of the name of a sensor or worker."""
TEXT_OF_PATTERN = {
    CAPTURE_ID: "letters, digits, - and _, at most 64",
    PEER_NAME: "1 to 100 ASCII characters without spaces",
    "^[a-z]{2,3}(-[A-Za-z0-9]{2,8})?$": "names such as de or pt-BR",
}
"""Pattern of a text -> the same for people."""


def complaint(error: "ErrorDetails", *, found: bool = False) -> str:
    """Say in one sentence what is wrong with a field; `found` adds the value that it had.

    What this module does not know by name is said as pydantic says it.
    """
    context = {name: f"{value:g}" if isinstance(value, float) else value
               for name, value in error.get("ctx", {}).items()}
    kind = error["type"]
    if kind in _EXPECTED:
        said = f"expected {_EXPECTED[kind].format(**context)}"
    elif kind == "value_error":
        said = str(context["error"])
    elif kind == "string_pattern_mismatch":
        pattern = context["pattern"]
        said = f"expected {TEXT_OF_PATTERN.get(pattern, f'a text that matches {pattern}')}"
    else:
        said = error["msg"]
    if not found or ", found " in said:
        return said
    given = error["input"]
    value = repr(str(given) if isinstance(given, PurePath | datetime) else given)
    return f"{said}, found {value if len(value) <= _SHOWN else value[:_SHOWN] + '...'}"
