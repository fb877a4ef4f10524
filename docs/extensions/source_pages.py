"""Links that lead out of these pages into the repository lead to a page with that file.

As on a forge, where the same links open the file; no address of one is known here.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import download_reference, pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.transforms import SphinxTransform
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.typing import ExtensionMetadata

_ROOT = Path(__file__).resolve().parents[2]
_LEXERS = {".py": "python", ".md": "markdown", ".ts": "typescript", ".js": "javascript",
           ".mjs": "javascript", ".toml": "toml", ".json": "json", ".cpp": "cpp", ".txt": "text",
           "": "sh"}
_FOLDER = "source"
_PAGES = {"CHANGELOG.md": "changelog", "CONTRIBUTING.md": "contributing", "README.md": "index",
          "SECURITY.md": "security",
          "decisions": "decisions", "docs/decisions": "decisions"}
"""Where pages and folders of the repository are on the site."""


def setup(app: Sphinx) -> ExtensionMetadata:
    """Rewrite the links, and write the pages in the end."""
    app.add_transform(FileLinks)
    app.add_post_transform(PageLinks)
    app.connect("env-purge-doc", _forget)
    app.connect("env-merge-info", _merge)
    app.connect("html-collect-pages", _pages)
    return {"version": "1", "env_version": 1,
            "parallel_read_safe": True, "parallel_write_safe": True}


class FileLinks(SphinxTransform):
    """Links to text files of the repository."""

    default_priority = 500

    def apply(self, **kwargs: Any) -> None:
        """Replace what else would be downloads."""
        del kwargs
        for node in list(self.document.findall(download_reference)):
            path = Path(self.env.srcdir, self.env.docname).parent / node["reftarget"]
            if node["reftarget"].startswith("/"):
                path = Path(f"{self.env.srcdir}{node['reftarget']}")
            path = Path(os.path.normpath(path))
            if path.suffix not in _LEXERS or not path.is_relative_to(_ROOT):
                continue
            name = path.relative_to(_ROOT).as_posix()
            _linked(self.env).setdefault(self.env.docname, set()).add(name)
            here = self.env.app.builder.get_target_uri(self.env.docname)
            there = os.path.relpath(f"{_FOLDER}/{name}.html", Path(here).parent)
            node.replace_self(nodes.reference("", "", *node.children, refuri=there, internal=True))


class PageLinks(SphinxPostTransform):
    """Links of pages that stand in the root of the repository, and links to folders."""

    default_priority = 8
    """Before MyST looks for what it calls targets, at 9."""

    def run(self, **kwargs: Any) -> None:
        """Lead to the page, where there is one; a folder's name is left as text."""
        del kwargs
        for node in list(self.document.findall(pending_xref)):
            if node["reftype"] != "myst":
                continue
            here, target = node.get("refdoc", self.env.docname), node["reftarget"]
            if Path(target).is_absolute():  # a page that is none of these
                target = f"{Path(target).relative_to(_ROOT).as_posix()}.md"
            if page := _PAGES.get(target):
                there = self.app.builder.get_relative_uri(here, page)
                node.replace_self(
                    nodes.reference("", "", *node.children, refuri=there, internal=True))
            elif target not in self.env.found_docs and any(
                    (base / target).is_dir()
                    for base in (_ROOT, Path(self.env.srcdir, here).parent)):
                node.replace_self(nodes.inline("", "", *node.children))


def _linked(env: BuildEnvironment) -> dict[str, set[str]]:
    """Give the files that each page links to."""
    if not hasattr(env, "denseface_linked"):
        env.denseface_linked = {}  # type: ignore[attr-defined]
    return env.denseface_linked  # type: ignore[attr-defined,no-any-return]


def _forget(app: Sphinx, env: BuildEnvironment, docname: str) -> None:
    del app
    _linked(env).pop(docname, None)


def _merge(app: Sphinx, env: BuildEnvironment, docnames: object, other: BuildEnvironment) -> None:
    del app, docnames
    _linked(env).update(_linked(other))


def _pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    for name in sorted(set().union(*_linked(app.env).values())):
        path = _ROOT / name
        shown = app.builder.highlighter.highlight_block(  # type: ignore[attr-defined]
            path.read_text(), _LEXERS[path.suffix], linenos=False)
        yield (f"{_FOLDER}/{name}", {
            "title": name, "body": f"<h1><code>{name}</code></h1>{shown}"}, "page.html")
