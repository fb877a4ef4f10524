"""Both sides of what the page is told are held to the same examples: `test/view/`, too."""

import json

import numpy as np
import pytest
from pydantic import ValidationError

from denseface.service.export.reading import Mesh
from denseface.service.view.meshes import encode_mesh
from denseface.service.view.messages import Fact, ItemHead, Listing, Seen
from tests.kiosk_states import VECTORS

EXAMPLES = json.loads((VECTORS / "view.json").read_text())


def test_each_example_is_read_and_written_as_it_stands():
    for kind, model in (("listings", Listing), ("seen", Seen)):
        for said in EXAMPLES[kind]:
            assert model.model_validate(said).model_dump(mode="json") == said


def test_the_examples_have_every_field_and_every_word():
    for model, said in ((Listing, EXAMPLES["listings"]), (Seen, EXAMPLES["seen"]),
                        (ItemHead, EXAMPLES["listings"][0]["items"]),
                        (Fact, EXAMPLES["seen"][0]["figures"])):
        for name in model.model_fields:
            assert any(one[name] for one in said), f"{model.__name__}.{name}"
    assert {one["shape"] for one in EXAMPLES["seen"]} == {"face", "mesh", "none"}
    assert {one["kind"] for one in EXAMPLES["listings"][0]["items"]} == {
        "face", "frames", "capture", "mesh"}


def test_what_is_no_message_is_refused():
    with pytest.raises(ValidationError):
        Seen(shape="cube", title="x")
    with pytest.raises(ValidationError):
        Listing.model_validate(EXAMPLES["listings"][0] | {"more": 1})


def test_a_mesh_has_the_bytes_that_the_page_is_tested_with():
    data = (VECTORS / "cube.mesh").read_bytes()
    points = np.frombuffer(data, "<f4", 24, 20).reshape(8, 3)
    triangles = np.frombuffer(data, "<u4", 36, 20 + 96).reshape(12, 3).astype(np.int32)
    colors = np.frombuffer(data, np.uint8, 24, 20 + 96 + 144).reshape(8, 3)
    assert encode_mesh(Mesh(points, triangles, colors)) == data
    assert len(encode_mesh(Mesh(points, None, None))) == 20 + 96
