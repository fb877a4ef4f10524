"""Both sides of the page's socket are held to the same examples, which `messages.test.ts` reads."""

import json
import types
from enum import StrEnum
from typing import Any, Union, get_args, get_origin, get_type_hints

import pytest
from pydantic import BaseModel, ValidationError

from denseface.service.kiosk.page_messages import (
    FROM_PAGE,
    FaceHead,
    FromPage,
    Hello,
    MirrorHead,
    Screen,
)
from tests.kiosk_states import VECTORS

EXAMPLES: dict[str, list[Any]] = json.loads((VECTORS / "messages.json").read_text())
READERS = {"screen": Screen, "hello": Hello}


def _models(annotation: Any) -> set[type[BaseModel]]:
    """Give the models that an annotation is made of, all the way down."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return {annotation}.union(*(
            _models(hint) for hint in get_type_hints(annotation).values()))
    return set().union(*(_models(part) for part in get_args(annotation)))


def _values(annotation: Any) -> set[str]:
    """Give the words of the enumerations in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, StrEnum):
        return set(annotation)
    if get_origin(annotation) in {Union, types.UnionType}:
        return set().union(*(_values(part) for part in get_args(annotation)))
    return set()


def _seen(value: Any, found: dict[type, list[BaseModel]]) -> None:
    if isinstance(value, BaseModel):
        found.setdefault(type(value), []).append(value)
        for _, part in value:
            _seen(part, found)
    elif isinstance(value, tuple):
        for part in value:
            _seen(part, found)


def _read() -> list[BaseModel]:
    return [*(FROM_PAGE.validate_python(said) for said in EXAMPLES["from_page"]),
            *(READERS[said["kind"]].model_validate(said) for said in EXAMPLES["to_page"]),
            *(MirrorHead.model_validate(said) for said in EXAMPLES["mirror_heads"]),
            *(FaceHead.model_validate(said) for said in EXAMPLES["face_heads"])]


def test_each_example_is_read_and_written_as_it_stands():
    written = [said.model_dump(mode="json") for said in _read()]
    assert written == [said for kind in ("from_page", "to_page", "mirror_heads", "face_heads")
                       for said in EXAMPLES[kind]]


def test_the_examples_have_every_message_every_field_and_every_word():
    found: dict[type, list[BaseModel]] = {}
    for said in _read():
        _seen(said, found)
    models = {*get_args(FromPage)}.union(
        *(_models(one) for one in (Screen, Hello, MirrorHead, FaceHead)))
    assert found.keys() == models
    for model in models:
        for name, field in model.model_fields.items():
            values = [getattr(said, name) for said in found[model]]
            assert any(value is not None for value in values), f"{model.__name__}.{name}"
            words = _values(field.annotation)
            missing = [word for word in words if word not in values]
            assert not missing, f"{model.__name__}.{name}"


@pytest.mark.parametrize("said", [
    '{"kind": "begin"}', '{"kind": "begin", "visit": -1}', '{"kind": "open", "visit": 1}',
    '{"kind": "consent", "visit": 1, "agreed": 1.5, "language": "en"}',
    '{"kind": "consent", "visit": 1, "agreed": true, "language": "../en"}',
    '{"kind": "drawn", "visit": 1, "capture_id": "../1"}',
    '{"kind": "begin", "visit": 1, "more": 1}', "[]", "", "\ud800"])
def test_what_no_page_says_is_refused(said):
    with pytest.raises((ValidationError, UnicodeEncodeError)):
        FROM_PAGE.validate_json(said)
