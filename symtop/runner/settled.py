"""Is everything in a folder of results what ``symtop study --all`` would make now? A note beside the cases says so.

It holds a hash of what all studies are made of: the code of symtop and of the studies, the versions of packages, what
installed packages announce, the processor and the grid. And it holds the size and the time of the last change of every
file of theirs. Asking takes a quarter of a second; each study by itself (`seen`) finds the same, but to import them all
takes 3 s.
"""

import importlib.metadata
import importlib.util
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from symtop.core.code_hash import PACKAGE, digest, file_hash, hashed, packages, processor

ENTRY_POINTS = "symtop.integrators"  # as in `symtop.methods.framework.registry`, which takes 0.3 s to import
STUDIES = ("symtop_studies", "studies")  # folders beside the package, as in `scripts`
NOTE = Path("cases") / "settled.json"


def announced() -> str:
    """The hash of what installed packages announce to symtop, and of the code of these packages."""
    points = sorted(importlib.metadata.entry_points(group=ENTRY_POINTS), key=str)
    code = [file_hash(path) for name in sorted({point.module.partition(".")[0] for point in points})
            for path in _sources(name)]  # fmt: skip
    return hashed(*map(str, points), *code)


def _sources(module: str) -> list[Path]:
    """The files of a module or a package, which is not imported."""
    spec = importlib.util.find_spec(module)
    if spec is None:
        return []
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    alone = [Path(spec.origin)] if spec.origin and not folders and Path(spec.origin).is_file() else []
    return alone + sorted(path for folder in folders for path in folder.rglob("*.py"))


def made_by(grid: str) -> str:
    """The hash of what makes the results of all studies on a grid: "", "quick" or "full"."""
    folders = [PACKAGE, *(place for name in STUDIES if (place := PACKAGE.parent / name).is_dir())]
    code = {
        f"file {path.relative_to(PACKAGE.parent).as_posix()}": file_hash(path)
        for folder in folders for path in folder.rglob("*.py")
    }  # fmt: skip
    facts = {"announced": announced(), "processor": processor(), "grid": grid}
    return digest(code | packages() | packages("matplotlib") | facts)


def grid_of(*, quick: bool, full: bool) -> str:
    """The word for a grid."""
    return "quick" if quick else "full" if full else ""


def _marks(results: Path, names: Sequence[str]) -> dict[str, list[int]]:
    """Size and time of the last change (ns) of every file of some studies."""
    files = [path for name in names for path in (results / "cases" / name).glob("[!.]*")]
    files += [path for name in names for path in (results / "figures").glob(f"{name}-*")]
    files += [results / f"{name}.{kind}" for name in names for kind in ("nc", "json")]
    facts = ((path.relative_to(results).as_posix(), path.stat()) for path in files)
    return {name: [told.st_size, told.st_mtime_ns] for name, told in facts}


def note(results: Path, names: Sequence[str], made: str) -> None:
    """Remember that these are all studies, and up to date."""
    from symtop.runner import store  # 0.4 s

    store.write_json(results / NOTE, {"made_by": made, "names": list(names), "files": _marks(results, names)})


def findings(results: Path, grid: str) -> list[dict[str, Any]] | None:
    """The findings of all studies, in their order, if nothing of them has changed since they were noted."""
    try:
        noted = json.loads((results / NOTE).read_text(encoding="utf-8"))
        names = [str(name) for name in noted["names"]]
        if noted["files"] != _marks(results, names) or noted["made_by"] != made_by(grid):
            return None
        known = [json.loads((results / f"{name}.json").read_text(encoding="utf-8")) for name in names]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return known if all(isinstance(one, dict) for one in known) else None
