"""What a study declares. The runner does the rest.

A study is a question, a grid of cases, a function that measures one case, and functions that turn the combined
dataset into figures, tables and sentences. It holds no numerics of its own.
"""

import hashlib
import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import xarray as xr

from symtop import datasets

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMERICS = (
    "top.py",
    "charts.py",
    "scenes.py",
    "exact*.py",
    "pairs.py",
    "reference.py",
    "simulate.py",
    "oscillator.py",
    "integrators/*.py",
    "measure/*.py",
)


class Picture(NamedTuple):
    """A figure of the report: its file name, caption and text for those who cannot see it."""

    name: str
    figure: "Figure"
    caption: str
    alt: str


class Table(NamedTuple):
    """A table of the report; cells are shown as they are."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Case:
    """One cell of a study's grid: an integrator on a scene, with settings that JSON can hold."""

    scene: str
    integrator: str
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """A name that is safe in a file."""
        return f"{self.scene}--{self.integrator}".replace("/", "_")


@dataclass(frozen=True)
class Study:
    """A question and how it is answered."""

    name: str
    title: str
    question: str
    how_to_read: str
    cases: Callable[[bool], list[Case]]  # quick -> grid
    measure: Callable[[Case], xr.Dataset]
    pictures: Callable[[xr.Dataset], list[Picture]]
    verdict: Callable[[xr.Dataset], list[str]]
    tables: Callable[[xr.Dataset], list[Table]] = lambda _: []
    timed: bool = False  # timed cases run one at a time, on a machine that does nothing else

    def digest(self, case: Case) -> str:
        """Hash of everything the case's numbers depend on: settings, the way of measuring, sources, versions."""
        from symtop.study import plugins  # noqa: PLC0415

        content = [
            json.dumps([self.name, case.scene, case.integrator, dict(case.settings)], sort_keys=True),
            _source(self.measure),
            numerics_digest(),
            plugins.digest_of(case.scene),
            plugins.digest_of(case.integrator),
            datasets.provenance()["dependencies"],
            datasets.provenance()["processor"] if self.timed else "",
        ]
        return hashlib.sha256("\n".join(content).encode()).hexdigest()[:20]


def _source(function: Callable[..., Any]) -> str:
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return repr(function)


_digests: dict[Path, str] = {}


def numerics_digest() -> str:
    """Hash of the package's numerical sources."""
    package = Path(__file__).resolve().parent.parent
    if package not in _digests:
        digest = hashlib.sha256()
        for pattern in NUMERICS:
            for path in sorted(package.glob(pattern)):
                digest.update(path.read_bytes())
        _digests[package] = digest.hexdigest()
    return _digests[package]
