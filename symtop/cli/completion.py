"""Shell completion: the names of scenes, integrators and studies, from a file.

Listing them imports every kernel family, which takes a second at each press of a key. Names are therefore kept in the
cache folder and listed again only if a file of the package or the set of installed packages has changed since.
"""

import contextlib
import json
import os
import sysconfig
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from symtop import __version__
from symtop.core.files import cache_root

PACKAGE = Path(__file__).resolve().parents[1]
LISTED = ("methods", "model", "runner")  # folders of the package whose files name something, beside the studies

Completion = Callable[[click.Context, click.Parameter, str], list[str]]


def _stamp() -> str:
    """What changes when a name may have changed: files and their times, and the folder that packages install into."""
    places = [*(PACKAGE / name for name in LISTED), PACKAGE.parent / "studies", PACKAGE.parent / "symtop_studies"]
    files = sorted(path for place in places for path in place.glob("*") if place.is_dir())
    times = [f"{path}:{path.stat().st_mtime_ns}" for path in [*files, Path(sysconfig.get_paths()["purelib"])]]
    return "\n".join([__version__, *times])


def _listed() -> dict[str, list[str]]:
    from symtop.methods.framework.registry import integrators, variants
    from symtop.model.scenes import scenes
    from symtop.runner import scripts

    every = [one.name for one in variants()]
    return {
        "scenes": list(scenes()),
        "integrators": list(integrators()),
        "variants": every,
        "studies": list(scripts.names()),
    }


def names() -> dict[str, list[str]]:
    """The names of each kind, "scenes", "integrators", "variants" and "studies", from the file if it is up to date."""
    file, stamp = cache_root() / "names.json", _stamp()
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        stored: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        if stored["stamp"] == stamp:
            return dict[str, list[str]](stored["names"])
    listed = _listed()
    with contextlib.suppress(OSError):  # a folder that cannot be written costs time and nothing else
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_name(f".names-{os.getpid()}.json")
        partial.write_text(json.dumps({"stamp": stamp, "names": listed}), encoding="utf-8")
        partial.replace(file)
    return listed


def completing(kind: str) -> Completion:
    """Shell completion of the names of scenes, integrators or studies; after a bracket, of variants like rk4[axis]."""

    def complete(_: click.Context, __: click.Parameter, prefix: str) -> list[str]:
        wanted = "variants" if kind == "integrators" and "[" in prefix else kind
        return [name for name in names()[wanted] if name.startswith(prefix)]

    return complete
