"""A small study for the tests of the runner: quick is four cases in this process, full is twelve in a pool.

Its measure writes a line to $PROBE_LOG when it begins, so that a test can count what was computed and how often, and
pauses for $PROBE_PAUSE seconds, so that a test can interrupt it. Methods whose name begins with "bad-" take part.
"""

import os
import time
from pathlib import Path

import matplotlib.pyplot as plt
import xarray as xr
from tqdm import tqdm

from symtop.methods.framework.registry import integrator, integrators
from symtop.model.scenes import scene
from symtop.run.simulation import simulate
from symtop.runner.study import Case, Picture, Study

METHODS = ("midpoint", "stormer-verlet", "strang", "gauss-4", "rk4", "rk45")


def cases(quick: bool) -> list[Case]:
    methods = [*METHODS[: 2 if quick else None], *(name for name in integrators() if name.startswith("bad-"))]
    controls = {"rk45": {"tolerance": 1e-6}}
    return [Case(w, name, controls.get(name, {"step_size": 0.01})) for w in ("goldstein", "loop") for name in methods]


def measure(case: Case) -> xr.Dataset:
    with Path(os.environ.get("PROBE_LOG", os.devnull)).open("a") as log:
        log.write(f"{case.label}\n")
    tqdm(total=1, disable=True)  # as a long run has one
    time.sleep(float(os.environ.get("PROBE_PAUSE", "0")))
    run = simulate(scene(case.scene), integrator(case.integrator), samples=51, observe="axis", guard=False,
                   **case.settings)  # fmt: skip
    return xr.Dataset({"energy": ("sample", run["energy"].values), "outcome": run.attrs["outcome"]})


def pictures(data: xr.Dataset) -> list[Picture]:
    figure, axis = plt.subplots(figsize=(2, 2), layout="constrained")
    axis.plot(data["energy"].values.reshape(-1))
    return [Picture("energy", figure)]


def facts(data: xr.Dataset) -> dict[str, float]:
    return {"largest": float(abs(data["energy"]).max())}


STUDY = Study("probe", "Probe", "Is it whole?", cases, measure, facts, pictures)
