"""How script/docs makes the site of these pages."""

import sys
from pathlib import Path

_DOCS = Path(__file__).resolve().parent
# The code beside these pages, whatever is installed.
sys.path[:0] = [str(_DOCS.parent), str(_DOCS / "extensions")]

from denseface.version import VERSION  # noqa: E402

project = "denseface"
author = copyright = "The denseface authors"  # noqa: A001
release = version = VERSION

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "decision_index",
    "house_docstrings",
    "mathml",
    "public_names",
    "source_pages",
    "tables",
]
exclude_patterns = ["examples/**/node_modules"]
nitpicky = True
# Only what is ours must be found: no inventory of another project is fetched.
nitpick_ignore_regex = [
    (r"py:.*", r"(?!denseface\.).*"),
    (r"py:class", r"denseface\..*\b(_\w+|Changes|Memory|BaseModel|CheckedModel)"),
]
html_math_renderer = "mathml"
linkcheck_ignore = [r"(?!https?://)"]  # pages of the site itself, which the build looks for

# Markdown as a forge shows it.
myst_heading_anchors = 6
myst_fence_as_directive = ["math"]
myst_links_external_new_tab = False

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
# A word in backticks of a docstring leads to what it names, if anything.
highlight_language = "none"
default_role = "py:obj"
python_use_unqualified_type_names = True
maximum_signature_line_length = 90
toc_object_entries_show_parents = "hide"

html_theme = "pydata_sphinx_theme"
html_title = f"denseface {version}"
html_context = {"default_mode": "auto"}
html_theme_options = {
    "logo": {"text": "denseface"},
    "icon_links": [],
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 7,
    "footer_start": ["copyright"],
    "footer_end": [],
    "navigation_with_keys": False,
    "pygments_light_style": "default",
    "pygments_dark_style": "github-dark",
}
html_sidebars: dict[str, list[str]] = {"index": [], "changelog": [], "contributing": []}
html_static_path = ["static"]
html_css_files = ["denseface.css"]
html_copy_source = html_show_sourcelink = False
html_show_sphinx = False
