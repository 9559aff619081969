"""The README and the pages of docs/ say what the code says: tables are the generated ones, links lead somewhere.

What blocks of code do is in `tests.docs.test_blocks`.
"""

import re

from tests.commands import call
from tests.pages import ROOT, pages

PAGES = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in pages()}


def test_the_table_of_integrators_is_the_generated_one():
    shown = re.search(r"<!-- integrators -->\n(.*?)\n<!-- /integrators -->", PAGES["docs/integrators.md"], re.DOTALL)
    assert shown is not None
    today = call("integrators", "--markdown").output.splitlines()
    assert set(shown.group(1).splitlines()) <= set(today), "regenerate: symtop integrators --markdown"


def test_every_study_is_explained():
    for script in (ROOT / "studies").glob("*/study.py"):
        assert f"| `{script.parent.name}` |" in PAGES["docs/studies.md"]


def test_pictures_and_links_are_there():
    for page, text in PAGES.items():
        for link in re.findall(r"\]\((?!https?://)([^)#]+)\)", text):
            assert (ROOT / page).parent.joinpath(link).is_file(), (page, link)
    files = {path.name for path in (ROOT / "docs").glob("*.md")} - {"index.md"}  # which begins with the README
    assert files == set(re.findall(r"\(docs/([\w-]+\.md)\)", PAGES["README.md"]))
