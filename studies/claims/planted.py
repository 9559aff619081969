"""Integrators that make one false claim each: the plug-ins in `liars`, each judged by a fresh process as any other is.

They check the battery itself: it must refute the false claim of each of them, besides confirming true claims.
"""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from symtop_studies import fresh_process

from symtop.core.code_hash import file_hash
from symtop.judging.battery import SCENE, judge
from symtop.judging.findings import Finding
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import scene
from symtop.run import plugins
from symtop.runner.study import Case

LIARS = Path(__file__).with_name("liars")
PREFIX = "planted-"  # of their names in the study, so that no user's plug-in is taken for one of them
FALSE = {  # file: the claim that is false
    "wrong-start": "order", "symplectic-rk4": "symplectic", "coefficients-swapped": "order", "hidden-kick": "symmetric",
    "one-newton": "energy", "coefficient-off": "order", "verlet-swapped": "order", "leaking-momentum": "p_phi",
    "leaking-chart": "p_phi", "reported-leak": "reported", "copied-momenta": "p_psi", "copied-in-angles": "reported",
    "rounded-triple": "order", "adaptive-implicit": "explicit",
}  # fmt: skip
LIES = {PREFIX + name: claim for name, claim in FALSE.items()}
QUICK = tuple(PREFIX + name for name in ("symplectic-rk4", "hidden-kick", "coefficients-swapped", "reported-leak"))


def file_of(name: str) -> Path:
    """The plug-in that registers one of `LIES`."""
    return LIARS / f"{name.removeprefix(PREFIX).replace('-', '_')}.py"


def cases(quick: bool) -> list[Case]:
    """One case for each integrator."""
    return [
        Case(SCENE, name, {"quick": quick, "code": file_hash(file_of(name))}) for name in (QUICK if quick else LIES)
    ]


def findings(name: str, quick: bool) -> list[dict[str, Any]]:
    """In this process: load one of `LIES` and judge it."""
    (registered,) = plugins.load(file_of(name))
    ledger = judge(integrator(registered), scene(SCENE), quick=quick)
    return [finding.plain() for finding in ledger.findings]


def measured(case: Case) -> xr.Dataset:
    """The findings on one of them. A fresh process loads it, so that other cases of this process are not affected."""
    each = fresh_process.call(findings, case.integrator, case.settings["quick"])
    columns = {name: [np.nan if row[name] is None else row[name] for row in each] for name in Finding._fields}
    claims = columns.pop("claim")
    return xr.Dataset({name: ("claim", values) for name, values in columns.items()}, coords={"claim": claims})
