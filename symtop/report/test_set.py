"""A test set for any language: motions of 30 bodies at 100 times to 30 digits, with checkers in Python and in C.

Two free bodies of each of five strata, ten heavy ones, five of them chaotic (`symtop.run.ensemble.bodies`), and ten
symmetric tops as bodies. The states are those of `symtop.model.exact.body_digits`, which computes with integers, so
that files are reproducible. A state of 17 digits determines its doubles. The numbers of a problem and the times are the
doubles nearest to the printed numbers, in every file.
"""

import tempfile
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError, file_path
from symtop.core.progress import post
from symtop.model.exact.body_digits import Digits, body_digits
from symtop.model.scenes import Scene
from symtop.report.archive import even_times, printed
from symtop.report.template import environment
from symtop.run.ensemble.bodies import body_population, scenes_of

SEED, TIMES, PERIODS = 48, 100, 5.0
SHARES = {"short-axis": 2, "long-axis": 2, "near-separatrix": 2, "near-symmetric": 2, "needle": 2, "regular": 5,
          "chaotic": 5, "lagrange": 10}  # fmt: skip
GIVEN = ("I1", "I2", "I3", "mgl", "cx", "cy", "cz", "qw", "qx", "qy", "qz", "wx", "wy", "wz")
STATE = ("qw", "qx", "qy", "qz", "Lx", "Ly", "Lz")
ROUNDED = {17: 4.5e-16, 30: 1e-29}  # rad, and relative to |L|: the rounding error of states by their digits
CHECKERS = ("check.py", "check.c")


def problems() -> list[Scene]:
    """The bodies and their starts."""
    populations = (body_population(count, seed=SEED, kind=kind) for kind, count in SHARES.items())
    return [scene for members in populations for scene in scenes_of(members)]


def times_of(scene: Scene) -> list[float]:
    """The times of a problem, rounded to six digits."""
    return even_times(PERIODS * scene.nutation_period, TIMES)


def write(folder: str | Path, scenes: Sequence[Scene] | None = None) -> Path:
    """Write the test set, or one of other `scenes`, into a folder, which must be new or empty. It takes a minute."""
    path, scenes = file_path("output", folder), list(scenes or problems())
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise SymtopError(f"the test set needs a folder that is new or empty, not {str(folder)!r}")
    path.mkdir(parents=True, exist_ok=True)
    tempfile.TemporaryFile(dir=path).close()  # raises if the folder cannot be written
    motions = list[Digits]()
    for scene in scenes:
        post(f"test set: {len(motions)} of {len(scenes)} motions")
        motions.append(body_digits(scene.top, scene.start, times_of(scene)))
    rows = [",".join([scene.name, *map(repr, scene.top.flat(scene.start))]) for scene in scenes]
    files = {"problems.csv": "\n".join([",".join(["name", *GIVEN]), *rows, ""])}
    files |= {f"states-{digits}.csv": _states_csv(scenes, motions, digits) for digits in ROUNDED}
    kinds = [scene.name.rpartition("-")[0] for scene in scenes]
    readme = environment().get_template("test-set.md").render(
        count=len(scenes), times=TIMES, gap=max(motion.bound for motion in motions), chaotic=kinds.count("chaotic"),
        free=sum(scene.top.free for scene in scenes),
    )  # fmt: skip
    files["README.md"] = f"{readme}\n"
    for name, text in files.items():
        (path / name).write_text(text, encoding="utf-8", newline="\n")
    for name in CHECKERS:
        (path / name).write_bytes(resources.files("symtop.report").joinpath("templates", f"{name}.txt").read_bytes())
    netcdf.write(states(scenes, motions), path / "states.nc")
    return path


def _states_csv(scenes: Sequence[Scene], motions: Sequence[Digits], digits: int) -> str:
    lines = [",".join(["name", "time", *STATE, "bound"])]
    for scene, motion in zip(scenes, motions, strict=True):
        bound = f"{ROUNDED[digits] + motion.bound:.2g}"
        for time, q, L in zip(times_of(scene), motion.quaternion, motion.momentum, strict=True):
            lines.append(",".join([scene.name, repr(time), *(printed(value, digits) for value in (*q, *L)), bound]))
    return "\n".join([*lines, ""])


def states(scenes: Sequence[Scene], motions: Sequence[Digits]) -> xr.Dataset:
    """The states as pairs of doubles over ``problem`` and ``sample``, and the numbers of the problems."""
    variables: dict[str, Any] = {"time": (("problem", "sample"), [times_of(scene) for scene in scenes])}
    vectors = {"quaternion": ("part", "1"), "momentum": ("component", "1")}
    for name, (dimension, units) in vectors.items():
        exact = np.array([getattr(motion, name) for motion in motions], dtype=object)
        high = exact.astype(float)
        words = {"quaternion": "attitude, body to space", "momentum": "angular momentum, space frame"}[name]
        dims, low = ("problem", "sample", dimension), (exact - high).astype(float)
        variables[name] = dims, high, {"long_name": words, "units": units}
        variables[f"{name}_lo"] = dims, low, {"long_name": f"what {name} lacks, to be added", "units": units}
    numbers = np.array([scene.top.flat(scene.start) for scene in scenes])
    for k, name in enumerate(GIVEN):
        attributes = {"long_name": f"{name} of the problem, as in problems.csv", "units": "1"}
        variables[f"given_{name}"] = "problem", numbers[:, k], attributes
    bounds = [motion.bound + ROUNDED[30] for motion in motions]
    words = "bound on the error of the attitude, rad, and of the momentum, relative"
    variables["bound"] = "problem", bounds, {"long_name": words, "units": "1"}
    names = ("problem", [scene.name for scene in scenes], {"long_name": "name of the problem"})
    data = xr.Dataset(variables, {"problem": names, "component": list("xyz"), "part": list("wxyz")})
    data["time"].attrs.update(long_name="elapsed time", units="1")
    data["component"].attrs["long_name"] = "component of a vector in the space frame"
    data["part"].attrs["long_name"] = "part of a quaternion"
    data.attrs["title"] = f"states of {len(scenes)} rigid bodies to 30 digits"
    return data
