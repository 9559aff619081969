"""A citable bundle: all results of the studies in one zip file for a repository of data.

    README.md                     what each file and variable is, its units, and how it was made
    results/*.nc, *.json          datasets and findings of the studies and of the comparisons beside them
    results/report.html, .md      the report, results/figures/ and results/tables/ what it shows; results/reference.md
    scenes/scenes.csv             tops and starts;  scenes/states.csv, .nc: their states to 30 digits
    citations.bib                 sources of the methods
    versions.txt, machine.txt     every installed package; processor, cores, memory, system
    SHA256SUMS                    of all others, as ``sha256sum -c`` reads them

Equal files make an equal bundle, except for the machine and the packages: it contains no date.

The states are a test set for other integrators, at ten times per scene, from a tenth of its horizon to all of it,
written with six digits. They are those of the closed form in 40 digits (`symtop.model.exact.digits`), from the top, the
start and the times as doubles, so that a program that reads the printed numbers as doubles has the same problem. The
sign of a quaternion is continuous from the start.
"""

import functools
import hashlib
import math
import os
import platform
import tempfile
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata, resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.core import __version__, netcdf
from symtop.core.errors import SymtopError, file_path
from symtop.core.files import replacing
from symtop.measure import columns
from symtop.model.exact.digits import PreciseForm
from symtop.model.scenes import Scene, scenes
from symtop.model.top import NUMBERS, flat
from symtop.report import page
from symtop.report.formats import table
from symtop.report.template import environment
from symtop.run.ensemble.population import memory

NAME = f"symtop-{__version__}-data"
EPOCH = (1980, 1, 1, 0, 0, 0)  # the time of every file in the bundle, the first that zip can store


def bundle(results: Path, target: str | Path | None = None) -> Path:
    """Write the bundle of a folder, after its report; by default NAME.zip there. SymtopError without findings."""
    path = results / f"{NAME}.zip" if target is None else file_path("output", target)
    if path.suffix != ".zip":
        raise SymtopError(f"output must be a file that ends in .zip, not {str(path)!r}", "output")
    page.write(results)
    files = {f"results/{path.relative_to(results).as_posix()}": path.read_bytes() for path in _stored(results)}
    with tempfile.TemporaryDirectory() as folder:
        file = netcdf.write(states(list(scenes().values())), Path(folder) / "states.nc")
        files["scenes/states.nc"] = file.read_bytes()
    files["scenes/states.csv"] = states_csv(list(scenes().values())).encode()
    files["scenes/scenes.csv"] = scenes_csv(list(scenes().values())).encode()
    files["citations.bib"] = resources.files("symtop.methods").joinpath("citations.bib").read_bytes()
    packages = {(str(package.metadata["Name"]), package.version) for package in metadata.distributions()}
    versions = (f"{name}=={version}\n" for name, version in sorted(packages, key=lambda pair: pair[0].lower()))
    files["versions.txt"] = "".join(versions).encode()  # as pip writes them
    files["machine.txt"] = _machine().encode()
    files["README.md"] = readme(results, files).encode()
    sums = "".join(f"{hashlib.sha256(content).hexdigest()}  {name}\n" for name, content in sorted(files.items()))
    files["SHA256SUMS"] = sums.encode()
    with replacing(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(f"{NAME}/{name}", EPOCH)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return path


def _stored(results: Path) -> list[Path]:
    """The files of a results folder that are bundled: no cases, and only figures and tables of the report."""
    studies = page.gather(results)
    report_files = {results / kind / item["file"] for study in studies for kind, items in (
        ("figures", study["pictures"]), ("tables", study["tables"])) for item in items}  # fmt: skip
    endings = "*.nc", "*.json", "report.html", page.WORDS, page.REFERENCE
    files = [path for ending in endings for path in results.glob(ending)]
    return sorted([*files, *report_files])


def readme(results: Path, files: Mapping[str, bytes]) -> str:
    """The README in Markdown: how the bundle was made, its files, and every variable of every dataset."""
    file_table = table(["file", "bytes"], [[name, f"{len(content):,}"] for name, content in sorted(files.items())])
    sections = [_section(f"results/{path.name}", netcdf.read_any(path)) for path in sorted(results.glob("*.nc"))]
    sections.append(_section("scenes/states.nc", states(list(scenes().values()))))
    return str(environment().get_template("archive.md").render(
        name=NAME, version=__version__, revision=netcdf.provenance()["symtop_revision"], times=TIMES, digits=DIGITS,
        working=WORKING, files=file_table, datasets=sections,
    ))  # fmt: skip


def _section(name: str, data: xr.Dataset | xr.DataTree) -> str:
    """A section of the README on one dataset: title, origin, and the variables of each group."""
    titles = [data.attrs.get(key, "") for key in ("title", "question")]
    origin = ", ".join(str(data.attrs[key]) for key in ("symtop_revision", "processor") if key in data.attrs)
    parts = [f"### {name}", " ".join(filter(None, map(str, titles))), f"Made by: {origin}." if origin else ""]
    for group, variables in netcdf.groups(data).items():
        rows = [
            [str(key), " x ".join(f"{dimension} ({length})" for dimension, length in variable.sizes.items()),
             str(variable.attrs.get("units", "")), str(variable.attrs.get("long_name", ""))]
            for key, variable in variables.variables.items()
        ]  # fmt: skip
        if rows:
            parts += [f"Group `{group}`:" if group else "", table(["variable", "dimensions", "unit", "meaning"], rows)]
    return "\n\n".join(filter(None, parts))


def _machine() -> str:
    """The machine that makes the bundle, one fact per line."""
    facts = {key: value for key, value in netcdf.provenance().items() if key != "dependencies"}
    facts |= {"cores": str(os.cpu_count()), "system": platform.platform()}
    if math.isfinite(memory()):
        facts["memory"] = f"{memory() / 2**30:.1f} GiB"
    return "".join(f"{key}: {value}\n" for key, value in facts.items())


DIGITS, WORKING = 30, 40  # printed, and computed
TIMES = 10  # per scene
ANGLES = NUMBERS[3:]
COLUMNS = (*ANGLES, "axis_x", "axis_y", "axis_z", "quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")
TITLE = f"States of the scenes at {TIMES} times, from the closed form in {WORKING} digits"


def even_times(end: float, count: int) -> list[float]:
    """`count` equidistant times up to `end`, rounded to six digits."""
    return [float(f"{end * k / count:.6g}") for k in range(1, count + 1)]


def times_of(scene: Scene) -> list[float]:
    """The times of a scene in the test set, in its units."""
    return even_times(scene.horizon, TIMES)


@functools.lru_cache(maxsize=256)  # 0.2 s per scene, and a bundle calls it three times
def precise(scene: Scene) -> list[list[Any]]:
    """The columns of `COLUMNS` at each time of a scene, as `mpmath.mpf` of 40 digits."""
    form = PreciseForm(scene.top, scene.start, WORKING)
    return [[*form(time), *form.axis(time), *form.quaternion(time)] for time in times_of(scene)]


def printed(number: Any, digits: int = DIGITS) -> str:
    """A number with `digits` significant digits."""
    from mpmath import nstr

    return str(nstr(number, digits, min_fixed=0, max_fixed=0, strip_zeros=False))


def states_csv(entries: Iterable[Scene]) -> str:
    """The states as CSV: scene, time, and `COLUMNS` with 30 digits each."""
    lines = [
        [scene.name, repr(time), *map(printed, state)]
        for scene in entries
        for time, state in zip(times_of(scene), precise(scene), strict=True)
    ]
    return str(pd.DataFrame(lines, columns=["scene", "time", *COLUMNS]).to_csv(index=False))


def scenes_csv(entries: Iterable[Scene]) -> str:
    """Tops and starts as CSV, every number with the 17 digits that name its double; angles in radians."""
    header = ["scene", *NUMBERS, "horizon", "nutation_period", "units", "purpose"]
    lines = [
        [scene.name, *map(repr, (*flat(scene.top, scene.start), scene.horizon, scene.nutation_period)),
         scene.units or "any consistent", scene.purpose]
        for scene in entries
    ]  # fmt: skip
    return str(pd.DataFrame(lines, columns=header).to_csv(index=False))


def states(entries: Sequence[Scene]) -> xr.Dataset:
    """The states as pairs of doubles: dimensions scene, sample, component and part.

    A value is ``NAME + NAME_lo``, which is good to 31 digits; I1, I3, mgl and the start ``NAME_0`` depend on scene.
    """
    exact = np.array([precise(scene) for scene in entries], dtype=object)
    values = exact.astype(float)
    dims = ("scene", "sample")
    variables: dict[str, Any] = {"time": (dims, [times_of(scene) for scene in entries])}
    for ending, numbers in (("", values), ("_lo", (exact - values).astype(float))):
        variables |= {f"{name}{ending}": (dims, numbers[..., k]) for k, name in enumerate(ANGLES)}
        variables[f"axis{ending}"] = ((*dims, "component"), numbers[..., 6:9])
        variables[f"quaternion{ending}"] = ((*dims, "part"), numbers[..., 9:])
    for name, column in zip(NUMBERS, zip(*(flat(row.top, row.start) for row in entries), strict=True), strict=True):
        variables[f"{name}_0" if name in ANGLES else name] = ("scene", list(column))
    names = [scene.name for scene in entries]
    coordinates = {"scene": names, "component": ["x", "y", "z"], "part": ["w", "x", "y", "z"]}
    data = netcdf.describe(columns.described(xr.Dataset(variables, coordinates)), TITLE)
    for name in (*ANGLES, "axis", "quaternion"):
        data[f"{name}_lo"].attrs.update(long_name=f"what {name} lacks, to be added", units=data[name].attrs["units"])
    for name in ANGLES:
        data[f"{name}_0"].attrs.update(long_name=f"{name} at the start", units=data[name].attrs["units"])
    return data
