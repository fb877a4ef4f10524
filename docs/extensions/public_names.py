"""A type or error is found under the name by which users import it.

Annotations name the module that defines a class (`denseface.recon.face.Face`), the pages describe
it where it is public (`denseface.Face`).
"""

import sys
from collections.abc import Iterator
from functools import cache
from importlib import import_module

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains.python import PythonDomain
from sphinx.environment import BuildEnvironment
from sphinx.util import logging
from sphinx.util.typing import ExtensionMetadata

_OURS = "denseface"
_PUBLIC = (
    "denseface", "denseface.capture", "denseface.recon", "denseface.recon.measurement",
    "denseface.recon.quality", "denseface.service.client", "denseface.service.errors",
    "denseface.service.export", "denseface.service.security")
"""Modules of which every public name is on a page, under one of its names."""
_log = logging.getLogger(__name__)


def setup(app: Sphinx) -> ExtensionMetadata:
    """Look for what a reference does not find."""
    app.connect("missing-reference", _find)
    app.connect("env-check-consistency", _look_for_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _look_for_all(app: Sphinx, env: BuildEnvironment) -> None:
    """Warn of each public name that no page has."""
    del app
    objects = env.domains.python_domain.objects
    shown = list(map(_value, objects))
    for module in map(import_module, _PUBLIC):
        for name in module.__all__:
            here = f"{module.__name__}.{name}"
            if here not in objects and not any(_value(here) is one for one in shown):
                _log.warning("no page of docs/api has %s", here)


def _find(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    del app
    if node.get("refdomain") != "py":
        return None
    domain = env.domains.python_domain
    target = node["reftarget"]
    for name in _others(domain, node.get("py:module") or _OURS, target):
        if name in domain.objects:
            return domain.resolve_xref(
                env, node["refdoc"], env.app.builder, "obj", name, node, content)
    return None


def _others(domain: PythonDomain, module: str, target: str) -> Iterator[str]:
    """Give the names that a thing has on these pages."""
    for prefix in ("", f"{module}.", f"{_OURS}."):
        thing = _thing(f"{prefix}{target}")
        if thing is not None:
            yield from (name for name in domain.objects if _thing(name) is thing)


def _thing(name: str) -> object:
    """Give a class or function by its dotted name; none is told by its value."""
    found = _value(name)
    return found if callable(found) else None


@cache
def _value(name: str) -> object:
    """Give what has a dotted name, of what is imported already."""
    module, _, attribute = name.rpartition(".")
    return getattr(sys.modules.get(module), attribute, None)
