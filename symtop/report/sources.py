"""What the report is made of: code, packages, and the files that it shows."""

import importlib.metadata
import importlib.util
from pathlib import Path

from symtop.core.code_hash import PACKAGE, digest, file_hash, hashed, packages, processor

ENTRY_POINTS = "symtop.integrators"  # as in `symtop.methods.framework.registry`, which takes longer to import
STUDIES = ("symtop_studies", "studies")  # folders beside the package, as in `symtop.runner.scripts`


def report_hash(results: Path, *, embed: bool) -> str:
    """Hash of what the report is made of, but for the content of its files (`report_files`).

    Its code is all of symtop, the studies, and packages that announce integrators; these are not imported.
    """
    points = sorted(importlib.metadata.entry_points(group=ENTRY_POINTS), key=str)
    specs = [importlib.util.find_spec(point.module.partition(".")[0]) for point in points]
    places = [Path(place) for spec in specs for place in (spec and spec.submodule_search_locations) or ()]
    code = {
        path.relative_to(folder.parent).as_posix(): file_hash(path)
        for folder in [PACKAGE, *(PACKAGE.parent / name for name in STUDIES), *places]
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    facts = {"announced": hashed(*map(str, points)), "processor": processor(), "embed": str(embed)}
    shown = {"shown": hashed(*(path.name for path in report_files(results)))}
    return digest(code | packages() | packages("matplotlib", "jinja2", "markdown-it-py") | facts | shown)


def report_files(results: Path) -> list[Path]:
    """The findings, datasets, figures and tables that the report shows or links."""
    return sorted(path for kind in ("*.json", "*.nc", "figures/[!.]*", "tables/[!.]*") for path in results.glob(kind))
