"""Cells that hold sentences are told from those that hold numbers, so that neither is squeezed."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util.typing import ExtensionMetadata

_SENTENCE = 60
"""Characters."""


def setup(app: Sphinx) -> ExtensionMetadata:
    """Look at the tables of every page."""
    app.add_transform(LongCells)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


class LongCells(SphinxTransform):
    """Gives long cells a class of their own, for the style sheet."""

    default_priority = 800

    def apply(self, **kwargs: Any) -> None:
        """Mark them."""
        del kwargs
        for cell in self.document.findall(nodes.entry):
            if len(cell.astext()) > _SENTENCE:
                cell["classes"].append("long")
