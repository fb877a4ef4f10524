"""Docstrings of this house as napoleon reads NumPy's.

Here `name : what it is, with shape and unit` stands in one line, where NumPy's form has a type
after the colon; and what is said of all parameters may follow them.
"""

import re

from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, NumpyDocstring
from sphinx.util.typing import ExtensionMetadata

_NAMED = {"Parameters", "Attributes"}
_RULE = re.compile(r"-{3,}$")
_ITEM = re.compile(r"(?P<names>\*{0,2}\w+(?:, \*{0,2}\w+)*) : (?P<text>.*)")
_CONFIG = Config(napoleon_use_rtype=False)
_SENTENCE = ("attribute", "data")
"""What has no sections. Napoleon takes what stands before a colon there for a type."""


def setup(app: Sphinx) -> ExtensionMetadata:
    """Rewrite docstrings, as napoleon itself would where it is an extension."""
    app.connect("autodoc-process-docstring", _rewrite)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _rewrite(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    if what not in _SENTENCE:
        lines[:] = NumpyDocstring(
            as_numpy(lines), _CONFIG, app, what, name, thing, options).lines()


def as_numpy(lines: list[str]) -> list[str]:
    """Give the lines of a docstring with each description below its name.

    A paragraph after the items of a section goes before the first section.
    """
    text: list[str] = []
    sections: list[str] = []
    section, strayed = "", False
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if line and _RULE.fullmatch(following):
            section, strayed = line, False
            sections += ["", line]
        elif section in _NAMED and (item := _ITEM.fullmatch(line)):
            strayed = False
            sections += [item["names"], f"    {item['text']}"]
        elif section in _NAMED and line and not line.startswith((" ", "---")):
            if not strayed:
                text.append("")
            strayed = True
            text.append(line)
        else:
            (text if strayed or not section else sections).append(line)
    return [*text, "", *sections]
