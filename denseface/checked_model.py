"""Models that people make by hand: what is wrong with one is a single line, of a named error."""

from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from denseface.validation import complaint

__all__ = ["FLATTENED", "CheckedModel", "first_line"]

FLATTENED = BeforeValidator(
    lambda given: given.ravel().tolist() if hasattr(given, "ravel") else given)
"""An array of any shape is as good as a list: OpenCV gives rows and columns."""


class CheckedModel(BaseModel):
    """A frozen model that knows its fields; made by a call, it raises `error` in one line.

    What is validated otherwise, from JSON or within another model, raises pydantic's own error,
    which has the whole path.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    error: ClassVar[type[Exception]] = ValueError

    if not TYPE_CHECKING:  # type checkers know the fields

        def __init__(self, **fields: Any) -> None:
            """Take the fields by name."""
            try:
                super().__init__(**fields)
            except ValidationError as error:
                unknown = next(iter(fields.keys() - type(self).model_fields.keys()), "")
                line = (f"{unknown}: no such field, expected one of "
                        f"{', '.join(type(self).model_fields)}" if unknown else first_line(error))
                raise self.error(line) from error

        # Or pydantic would call it for models within models too.
        __init__.__pydantic_base_init__ = True


def first_line(error: ValidationError, whole: str = "") -> str:
    """Give the first field that pydantic refuses, its path with dots, why, and what was found.

    `whole` is the name where all is refused.
    """
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, first["loc"])) or whole
    said = complaint(first, found=first["type"] not in (
        "missing", "extra_forbidden", "json_invalid", "value_error"))
    return f"{where}: {said}" if where else said
