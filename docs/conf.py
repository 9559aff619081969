"""How `make docs` builds the site: Sphinx with furo, pages in Markdown, notebooks as they are stored, nothing fetched.

Derivations and the API are docstrings, the gallery and the report page are what studies wrote, so that a page says
what the code says. Formulas are plain text, as in the sources: no page needs a script for mathematics.
"""

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]

import symtop  # noqa: E402  (of this tree)
from symtop.runner import scripts  # noqa: E402

scripts.install()  # theory pages show modules of studies, too

project = "symtop"
author = "The symtop authors"
project_copyright = author
release = symtop.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "generator.docstrings",
    "generator.gallery",
    "generator.links",
]
exclude_patterns = ["_build", "generator"]

nb_execution_mode = "off"  # tests/cli/test_notebooks.py runs them and compares what they print
myst_heading_anchors = 3
myst_enable_extensions: list[str] = []
suppress_warnings = ["myst.header"]  # a study's notes begin below its heading by two levels

autodoc_typehints_format = "short"
python_maximum_signature_line_length = 90
autodoc_member_order = "bysource"

copybutton_prompt_text = "$ "  # of console blocks; their output is not copied
copybutton_only_copy_prompt_lines = True

highlight_language = "none"  # formulas are plain text; blocks of code name their language
smartquotes = False

html_show_search_summary = False  # it fetches pages, which a browser refuses for files

html_theme = "furo"
pygments_style = "a11y-light"
pygments_dark_style = "github-dark"
html_title = "symtop"
html_static_path = ["generator/static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}
