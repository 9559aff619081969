"""Published values of this problem, compared with values computed here.

Each entry names its source, the published value, ours, and the kind of comparison: with ``printed`` digits, a printed
``formula``, or for ``consistency`` with the source's own data. Values agree if they round to the same digits.
"""

import math
from typing import NamedTuple

import numpy as np

from symtop.model.scenes import closed_form, scene as find_scene
from symtop.run.reference.truth import reference

TRAJECTORY, START, OTHER_BODY = "trajectory", "start", "another body"  # the last tests SciPy, not symtop


class KnownValue(NamedTuple):
    """One published number and ours."""

    source: str
    quantity: str
    published: float
    ours: float
    unit: float  # one unit of the last digit that is compared
    kind: str  # printed, formula or consistency
    tests: str = TRAJECTORY  # what the comparison tests: a trajectory of a top, its start, or another body

    @property
    def reproduced(self) -> bool:
        """Do they agree to the last printed digit?"""
        return abs(self.ours - self.published) <= 0.5000001 * self.unit


def published_values() -> list[KnownValue]:
    """All entries, each evaluated now."""
    scene, source = find_scene("simo-wong"), "Simo & Wong 1991; Krysl 2005"
    energy = scene.top.energy(scene.start)
    values = [KnownValue(source, "energy of the fast top", 1269.975, energy, 1e-3, "printed", tests=START)]

    source = "Bruls, Cardona & Arnold 2012"  # regression data of public codes, h = 2e-6
    displacement = reference("bruls-cardona-arnold", [1.0], "longdouble")["axis"].values[0] - np.array([0.0, 1.0, 0.0])
    for name, value, ours in zip("xyz", (0.17334, -0.35991, -0.74849), displacement, strict=True):
        quantity = f"{name} displacement of the centre at t = 1"
        values.append(KnownValue(source, quantity, value, ours, 1e-5, "printed"))

    scene = find_scene("separatrix")
    g = math.sqrt(scene.top.mgl / scene.top.I1)
    for t in (1.0, 5.0):
        quantity, exact = f"cos theta on the separatrix at t = {t:g}", 1.0 / (1.0 + 1.0 / math.cosh(g * t))
        ours = math.cos(float(closed_form(scene)(np.array([t])).theta[0]))
        values.append(KnownValue("Woodhouse, problem 5.3", quantity, exact, ours, 1e-13, "formula"))

    scene, source = find_scene("kinon-betsch"), "Kinon & Betsch"
    motion = closed_form(scene)(np.linspace(0.0, scene.horizon, 301))
    tilt, rate = math.degrees(motion.theta.max()), float(motion.phi_dot.mean())
    values.append(KnownValue(source, "largest tilt (deg)", 60.0, tilt, 1e-10, "consistency"))
    values.append(KnownValue(source, "precession rate", 10.0, rate, 1e-10, "consistency"))

    scene, source = find_scene("hairer-lubich-wanner"), "Hairer, Lubich & Wanner, figure VII.5.3"
    energy, vertical = scene.top.energy(scene.start), scene.top.momenta(scene.start).p_phi
    values.append(KnownValue(source, "energy", 1.72, energy, 1e-12, "consistency", tests=START))
    values.append(KnownValue(source, "vertical angular momentum", 1.04, vertical, 1e-12, "consistency", tests=START))

    from scipy.integrate import solve_ivp

    solution = solve_ivp(  # Euler's equations of DETEST B5, by SciPy's DOP853 at its tightest tolerance
        lambda _, y: (y[1] * y[2], -y[0] * y[2], -0.51 * y[0] * y[1]), (0.0, 20.0), (0.0, 1.0, 1.0),
        method="DOP853", rtol=3e-14, atol=1e-15,
    )  # fmt: skip
    source, printed = "Enright & Pryce 1987, DETEST B5", (-0.93965707987, -0.34211777540, 0.74141265962)
    return values + [
        KnownValue(source, f"y{k + 1}(20)", value, float(solution.y[k, -1]), 1e-11, "printed", OTHER_BODY)
        for k, value in enumerate(printed)
    ]
