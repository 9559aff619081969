"""A bundle that can be cited: everything that the studies measured, in one zip for a repository of data.

    README.md                     what each file and variable is, its units, and how it was made
    results/*.nc, *.json          datasets and findings of the studies and of the comparisons beside them
    results/report.html, .md      the report, results/figures/ its figures
    scenes/scenes.csv             tops and starts;  scenes/states.csv, .nc: their states to 30 digits (`scene_states`)
    citations.bib                 sources of the methods
    versions.txt, machine.txt     every installed package; processor, cores, memory, system
    SHA256SUMS                    of all others, as ``sha256sum -c`` reads them

Equal files make an equal bundle, but for the machine and the packages: it holds no time of its making.
"""

import hashlib
import os
import platform
import tempfile
import zipfile
from collections.abc import Mapping
from importlib import metadata, resources
from pathlib import Path

import xarray as xr

from symtop import __version__
from symtop.core import netcdf
from symtop.model.scenes import scenes
from symtop.report import page
from symtop.report.tables import table
from symtop.run.reference import scene_states

NAME = f"symtop-{__version__}-data"
EPOCH = (1980, 1, 1, 0, 0, 0)  # the time of every file in the bundle: zip has none before

INTRODUCTION = """\
Measurements of numerical integrators on the heavy symmetric (Lagrange) top. symtop {version}, code revision {revision},
ran every method at many step sizes or tolerances and compared it with the exact motion. `results/report.html` says
what was found and how it was measured: open it in a browser, no network is needed.

**How it was made.** `symtop study --all` computed the datasets; `symtop archive` bundled them. To repeat it, install
the packages of `versions.txt` and this revision of symtop, and run `make studies archive`. Times were taken on the
machine of `machine.txt`, unless a dataset names another processor below.

**The test set.** `scenes/scenes.csv` holds the tops and starts, each number to be read as the nearest double, and
`scenes/states.csv` their states at {times} times with {digits} digits, from the closed form in {working}
digits. `scenes/states.nc` holds the same as pairs of doubles, a value being `NAME + NAME_lo`. Angles are z-x-z: phi
precession, theta inclination from the upward vertical, psi spin, in radians, phi and psi unwrapped. The axis is
(sin theta sin phi, -sin theta cos phi, cos theta); quaternions are (w, x, y, z) from body to space.

**Licence.** BSD-3-Clause, as symtop. **To cite it**, name symtop, its version and this revision; sources of the methods
are in `citations.bib`.
"""


def bundle(results: Path, target: Path | None = None) -> Path:
    """Write the bundle of a results folder, whose report is written anew; returns the zip, NAME.zip there by default.

    Raises SymtopError if the folder holds no findings or the bundle cannot be written.
    """
    page.write(results)
    files = {f"results/{path.relative_to(results).as_posix()}": path.read_bytes() for path in _stored(results)}
    files |= _test_set()
    files["citations.bib"] = resources.files("symtop.methods").joinpath("citations.bib").read_bytes()
    files["versions.txt"] = _packages().encode()
    files["machine.txt"] = _machine().encode()
    files["README.md"] = readme(results, files).encode()
    sums = "".join(f"{hashlib.sha256(content).hexdigest()}  {name}\n" for name, content in sorted(files.items()))
    files["SHA256SUMS"] = sums.encode()
    path = target or results / f"{NAME}.zip"
    with netcdf.replacing(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(f"{NAME}/{name}", EPOCH)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return path


def _stored(results: Path) -> list[Path]:
    """The files of a results folder that are bundled: no cases, and no figure that the report does not show."""
    shown = {results / "figures" / picture["file"] for study in page.gather(results) for picture in study["pictures"]}
    files = [path for ending in ("*.nc", "*.json", "report.html", "report.md") for path in results.glob(ending)]
    return sorted([*files, *shown])


def _test_set() -> dict[str, bytes]:
    chosen = list(scenes().values())
    with tempfile.TemporaryDirectory() as folder:
        binary = netcdf.write(scene_states.states(chosen), Path(folder) / "states.nc").read_bytes()
    return {
        "scenes/states.nc": binary,
        "scenes/states.csv": scene_states.states_csv(chosen).encode(),
        "scenes/scenes.csv": scene_states.scenes_csv(chosen).encode(),
    }


def readme(results: Path, files: Mapping[str, bytes]) -> str:
    """What is in the bundle, in Markdown: how it was made, its files, and every variable of every dataset."""
    words = INTRODUCTION.format(
        version=__version__, revision=netcdf.provenance()["symtop_revision"], times=scene_states.TIMES,
        digits=scene_states.DIGITS, working=scene_states.WORKING,
    )  # fmt: skip
    listed = table(["file", "bytes"], [[name, f"{len(content):,}"] for name, content in sorted(files.items())])
    described = [_described(f"results/{path.name}", netcdf.read_any(path)) for path in sorted(results.glob("*.nc"))]
    described.append(_described("scenes/states.nc", scene_states.states(list(scenes().values()))))
    return "\n\n".join([f"# {NAME}", words.strip(), "## Files", listed, "## Datasets", *described]) + "\n"


def _described(name: str, data: xr.Dataset | xr.DataTree) -> str:
    """One dataset: what it is, where it was made, and its variables, group by group."""
    about = [data.attrs.get(key, "") for key in ("title", "question")]
    made = ", ".join(str(data.attrs[key]) for key in ("symtop_revision", "processor") if key in data.attrs)
    parts = [f"### {name}", " ".join(filter(None, map(str, about))), f"Made by: {made}." if made else ""]
    for group, variables in netcdf.groups(data).items():
        rows = [
            [str(key), " x ".join(f"{dimension} ({length})" for dimension, length in variable.sizes.items()),
             str(variable.attrs.get("units", "")), str(variable.attrs.get("long_name", ""))]
            for key, variable in variables.variables.items()
        ]  # fmt: skip
        if rows:
            parts += [f"Group `{group}`:" if group else "", table(["variable", "dimensions", "unit", "meaning"], rows)]
    return "\n\n".join(filter(None, parts))


def _packages() -> str:
    """Every package of this Python with its version, as pip writes them."""
    named = {(str(one.metadata["Name"]), one.version) for one in metadata.distributions()}
    return "".join(f"{name}=={version}\n" for name, version in sorted(named, key=lambda pair: pair[0].lower()))


def _machine() -> str:
    """The machine that makes the bundle, a fact a line."""
    facts = {key: value for key, value in netcdf.provenance().items() if key != "dependencies"}
    facts |= {"cores": str(os.cpu_count()), "system": platform.platform()}
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        facts["memory"] = f"{os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') / 2**30:.1f} GiB"
    return "".join(f"{key}: {value}\n" for key, value in facts.items())
