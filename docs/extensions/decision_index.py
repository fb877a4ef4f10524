"""The directive `decisions`: a table of the decisions, made from their files."""

import re
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

_HEAD = re.compile(r"# (?P<number>\d{4}): (?P<title>.+)\n"
                   r"Status: (?P<status>.+)\. Date: (?P<date>\d{4}-\d\d-\d\d)\.\n")


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the directive."""
    app.add_directive("decisions", Decisions)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


class Decisions(SphinxDirective):
    """Number, title, status and date of each decision in the folder beside the page."""

    def run(self) -> list[nodes.Node]:
        """Read the first two lines of each file."""
        rows = ["| | decision | status | date |", "| --- | --- | --- | --- |"]
        page = Path(self.get_source_info()[0])
        for path in sorted(page.with_suffix("").glob("*.md")):
            self.env.note_dependency(str(path))
            head = _HEAD.match(path.read_text())
            if head is None:
                raise self.error(f"{path.name}: no number, title, status and date at its head")
            rows.append(f"| {head['number']} | [{head['title']}]({page.stem}/{path.name}) "
                        f"| {head['status'].replace('](', f']({page.stem}/')} | {head['date']} |")
        made = self.parse_text_to_nodes("\n".join(rows))
        for table in made:
            if isinstance(table, nodes.table):
                table["classes"].append("decisions")
        return made
