"""Links to files of the repository that the site shows as a page of its own lead to that page."""

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

SHOWN = {"results/report": "reference/report", "README": "index", "CHANGELOG": "about/changelog"}  # file: page


def _lead(_app: Sphinx, doctree: nodes.document) -> None:
    """The page of a link, where MyST has the path of a file that is no source of the site."""
    for link in doctree.findall(addnodes.pending_xref):
        if link.get("refdomain") == "doc" and link["reftarget"].startswith("/"):
            for file, page in SHOWN.items():
                if link["reftarget"].endswith(f"/{file}"):
                    link["reftarget"] = page


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("doctree-read", _lead)
    return {"parallel_read_safe": True}
