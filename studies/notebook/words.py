"""Sentences and tables of the notebook study, from its dataset."""

import cmath
import math
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.measure.order import power_law
from symtop.model.charts import Array, axis_from_angles
from symtop.report.sentences import few, joined
from symtop.report.style import number
from symtop.runner.study import Table

from .derivations import notebook_top
from .long_energy import better_from, energy_until, notebook_end
from .tables import ALPHA, MIDPOINT, MODIFIED, SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION, Column

PARTS = {"spheroid": "first part", "goldstein": "second part"}  # of the notebook
MOMENTA = ("p_phi_largest", "p_psi_largest")
KEPT = 1e-12  # relative, over 8 s: a momentum that changes by less is kept to rounding
ORDER_TWO = ("midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]")
DRAWN = (*ORDER_TWO, "strang[axis]", "cayley[axis]")  # methods of order two that the figures name

HOW_TO_READ = (
    "A variant is a method in one chart, method[chart]. Each figure has what the notebook drew, by its own means, "
    "beside the truth; captions say what was reproduced, what was matched by choice and what was corrected. A discrete "
    "Lagrangian L_d(q0, q1) gives a step by p0 = -D1 L_d and p1 = D2 L_d. If L_d does not change when phi is shifted "
    "at both ends, D1 L_d + D2 L_d = 0 along phi and p_phi cannot change (Noether's theorem): a symmetry of L_d "
    "conserves a momentum, at any step. A splitting conserves it because each of its parts has the symmetry. L_d also "
    "generates a symplectic map, which follows a modified Hamiltonian up to exponentially small terms: the energy may "
    "oscillate by O(h^2), not drift."
)
MATCHED = (
    "Matched by choice, not reproduced: the notebook states no tolerance. LSODA gets "
    f"{SOLVER_TOLERANCE:g} here, at which it keeps the 5 figures of the energy and 6 of each momentum that the "
    "notebook reports to t = 8. Size and direction of its residuals depend on this choice."
)


def largest_momenta(data: xr.Dataset) -> dict[str, float]:
    """The largest relative residual of a momentum on any scene, by discrete method."""
    largest = data[list(MOMENTA)].drop_sel(variant=SOLVER).to_dataarray().max(("variable", "scene"), skipna=False)
    return dict(zip(largest["variant"].values.tolist(), largest.values.tolist(), strict=True))


def momenta(data: xr.Dataset) -> str:
    """Whether the discrete methods kept their momenta, at the one step that was measured, and why."""
    largest = largest_momenta(data)
    lost, count = [name for name, change in largest.items() if not change < KEPT], len(largest)
    step = f"at the step measured, {STEPS_A_NUTATION:.0f} a nutation"
    kept = f"all {count}" if not lost else f"{count - len(lost)} of {count}"
    rest = f", not with {few(lost)}" if lost else " (theory: at any step)"
    solver = data[list(MOMENTA)].sel(scene="spheroid", variant=SOLVER)
    return (
        f"With {kept} discrete Lagrangians and splittings both momenta are constant to rounding {step}{rest}. The "
        f"largest relative change is {max(largest.values()):.0e}, against {float(solver.to_dataarray().max()):.0e} "
        "with the solver on the first scene."
    )


def hopes(data: xr.Dataset) -> list[str]:
    """Whether, and from when on, the methods of order two keep the energy better than the solver."""
    return answer(data, ORDER_TWO)


def hope_message(data: xr.Dataset) -> str:
    """Beside how many methods of order two the solver keeps the energy better at the notebook's end, and at last."""
    shown = [method for method in DRAWN if method in data["variant"].values]
    parts, kept = [], True
    for scene in PARTS:
        largest = data["energy_largest"].sel(scene=scene)
        ahead = int((largest.sel(variant=shown) > float(largest.sel(variant=SOLVER))).sum())
        kept = kept and all(math.isfinite(better_from(data, scene, method)) for method in shown)
        parts.append((ahead, scene))
    (first, one), *others = parts
    last = float(data[Column.LONG_TIME].max())
    rest = "".join(f", {ahead} of {len(shown)} on {scene}" for ahead, scene in others)
    return (
        f"lsoda keeps the energy better than {first} of {len(shown)} methods of order two to the notebook's end on "
        f"{one}{rest}; by {last:g} s it is {'worse than each' if kept else 'not worse than all'} of them"
    )


def worse_energies(data: xr.Dataset, scene: str) -> tuple[int, int]:
    """How many discrete methods change the energy by more than the solver over the notebook's time, and of how many."""
    largest = data["energy_largest"].sel(scene=scene)
    discrete = largest.drop_sel(variant=SOLVER).values
    return int((discrete > float(largest.sel(variant=SOLVER))).sum()), len(discrete)


def residuals_message(data: xr.Dataset) -> str:
    """What the discrete methods keep better than the solver, and with how many the energy is worse."""
    lost = float(data[list(MOMENTA)].sel(variant=SOLVER).to_dataarray().max())
    counts = {scene: worse_energies(data, scene) for scene in PARTS}
    return (
        f"Discrete methods keep both momenta to {number(max(largest_momenta(data).values()))}, lsoda to "
        f"{number(lost)}; the energy is worse than lsoda's with "
        f"{' and '.join(f'{worse} of {count} on {scene}' for scene, (worse, count) in counts.items())}"
    )


def paths(data: xr.Dataset, scene: str) -> tuple[Array, Array]:
    """The path that the notebook drew and that of the axis, shape (times, 3)."""
    run = data.sel(scene=scene, variant=SOLVER)
    drawn = axis_from_angles(run[Column.SOLVER_THETA].values, run[Column.SOLVER_PHI].values + 0.5 * math.pi)
    return drawn, axis_from_angles(run[Column.TRUE_THETA].values, run[Column.TRUE_PHI].values)


def turned(data: xr.Dataset, scene: str) -> float:
    """The angle about the vertical, in degrees, by which the notebook's path is best turned from that of the axis."""
    drawn, true = (path[:, 0] + 1j * path[:, 1] for path in paths(data, scene))
    return math.degrees(cmath.phase(complex(np.nansum(drawn * true.conj()))))


def modified_message(data: xr.Dataset) -> str:
    """The powers of the step with which energy and modified energy change, of one method, as a title."""
    run = data.sel(scene="spheroid", variant=MODIFIED[0])
    slopes = [power_law(run[Column.MODIFIED_STEP].values, run[column].values).slope
              for column in (Column.ENERGY_CHANGE, Column.MODIFIED_CHANGE)]  # fmt: skip
    return (
        f"With {MODIFIED[0]} the energy changes as the step to the power {slopes[0]:.1f}, the modified energy as the "
        f"step to the power {slopes[1]:.1f}"
    )


def energy(data: xr.Dataset) -> str:
    """The energy of the discrete methods: bounded, and smaller than the solver's or not."""
    largest = data["energy_largest"].sel(scene="spheroid")
    errors = dict(zip(largest["variant"].values.tolist(), largest.values.tolist(), strict=True))
    limit = errors.pop(SOLVER)
    midpoint = data.sel(scene="spheroid", variant=MIDPOINT)
    gain = float(midpoint[Column.ENERGY_CHANGE][0] / midpoint[Column.MODIFIED_CHANGE][0])
    return (
        "The energy error of discrete Lagrangians and splittings is bounded, not small: "
        f"{sum(error < limit for error in errors.values())} of {len(errors)} have a smaller one than the solver "
        f"({limit:.0e}) on the first scene to t = 8. Their map conserves a modified Hamiltonian: at 40 steps a "
        f"nutation its first term lowers the energy change of the midpoint rule {gain:.0f}-fold."
    )


def verdict(data: xr.Dataset) -> list[str]:
    """What was reproduced, what was matched or corrected, and why the discrete methods win."""
    top, (polar, equatorial) = notebook_top()
    second = data.sel(scene="goldstein", variant=SOLVER)
    reproduced = (
        f"Reproduced: a spheroid of polar radius {polar:.5f} and equatorial radius {equatorial:.5f} has I1 = "
        f"{top.I1:g}, I3 = {top.I3:g} and mgl = {top.mgl:.4f}, and these inertias give the radii back; both "
        f"derivations agree to {float(data[Column.DERIVATIONS_GAP].max()):.0e} rad, and both energies to "
        f"{float(data[Column.ENERGY_GAP].max()):.0e} (relative) with E1 = E - p_psi^2/2 I3."
    )
    printed = (
        f"Corrected: alpha = {ALPHA:g} contradicts a release at rest, which has alpha = "
        f"{float(second[Column.ALPHA_AT_REST]):.6f}; the printed one means |theta'| = "
        f"{float(second[Column.ALPHA_RATE]):.6f} rad/s."
    )
    drawn = (
        "Corrected: the drawn path is a quarter turn from the axis. The inertia is that about the centre of gravity "
        "but is used about the pivot, and one letter is both the polar radius and the lever arm; from_spheroid with a "
        "pivot_distance is the physical reading."
    )
    return [*hopes(data), momenta(data), energy(data), reproduced, MATCHED, printed, drawn]


def modified_orders(data: xr.Dataset) -> dict[tuple[str, str], tuple[float, float]]:
    """Slopes of the energy change and of the modified energy's change against the step, by scene and variant."""
    slopes = {}
    for scene in map(str, data["scene"].values):
        for name in (row for row in MODIFIED if row in data["variant"].values):
            run = data.sel(scene=scene, variant=name)
            plain, modified = (
                power_law(run[Column.MODIFIED_STEP].values, run[column].values).slope
                for column in (Column.ENERGY_CHANGE, Column.MODIFIED_CHANGE)
            )
            slopes[scene, name] = plain, modified
    return slopes


def modified_sentence(data: xr.Dataset) -> str:
    """Both slopes, from the least to the largest over scenes and variants."""
    plain, modified = (
        f"{min(values):.2f} to {max(values):.2f}" for values in zip(*modified_orders(data).values(), strict=True)
    )
    return (
        f"H changes with the step to the power {plain}, the modified energy to its first term to the power {modified}."
    )


def tables(data: xr.Dataset) -> list[Table]:
    """The energy far beyond the notebook's end, and the largest residuals of every integrator."""
    rows = []
    for scene in data["scene"].values:
        for name in data["variant"].values:
            run = data.sel(scene=scene, variant=name)
            largest = [f"{float(run[f'{constant}_largest']):.1e}" for constant in CONSTANTS]
            since = better_from(data, str(scene), str(name))
            better = "" if name == SOLVER else f"{since:.3g}" if math.isfinite(since) else "not to the end"
            rows.append([str(scene), str(name), str(run[Column.OUTCOME].item()), *largest, better])
    header = ["scene", "variant", "outcome", "largest energy residual", "of p_phi", "of p_psi", "better from t (s)"]
    title = (
        f"Largest relative residuals over the notebook's own horizons ({STEPS_A_NUTATION:g} steps a nutation; {SOLVER} "
        f"at tolerance {SOLVER_TOLERANCE:g}), and the time from which the energy is kept better than by {SOLVER}"
    )
    powers = [[*place, *(f"{slope:.2f}" for slope in both)] for place, both in modified_orders(data).items()]
    modified = Table("Powers of the step with which the energy and the modified energy change",
                     ["scene", "variant", "energy", "modified energy"], powers)  # fmt: skip
    return [long_table(data, DRAWN), modified, Table(title, header, rows)]


UNCHANGED = 0.005  # relative: an error that grew by less is said not to have changed


def answer(data: xr.Dataset, named: tuple[str, ...]) -> list[str]:
    """Whether the discrete methods that are `named` keep the energy better than the solver, and from when on."""
    sentences = []
    for scene in map(str, data["scene"].values):
        shown = [name for name in named if name in data["variant"].values]
        largest = data["energy_largest"].sel(scene=scene)
        limit = float(largest.sel(variant=SOLVER))
        values = {name: float(largest.sel(variant=name)) for name in shown}
        worse, better = ([n for n in shown if (values[n] < limit) is wanted] for wanted in (False, True))
        parts = [
            f"{word} than {_listed(values, part, most)}"
            for word, part, most in (("better", worse, 2), ("worse", better, 4))  # the worse are named below
            if part
        ]
        sentences.append(
            f"On {scene}, to the notebook's t = {notebook_end(data, scene):g}, {SOLVER} keeps the energy to "
            f"{limit:.0e}, {' and '.join(parts)}. {_later(data, scene, worse)}".rstrip()
        )
    return sentences


def _listed(values: Mapping[str, float], names: Sequence[str], most: int) -> str:
    """Variants, by name if at most so many, with their errors, from the least to the largest."""
    ends = dict.fromkeys(f"{pick(values[name] for name in names):.0e}" for pick in (min, max))
    return f"{few(names, most=most)} ({' to '.join(ends)})"


def _later(data: xr.Dataset, scene: str, names: list[str]) -> str:
    """From when on the variants that are worse at first are better, one by one."""
    if not names:
        return ""
    last, end = float(data[Column.LONG_TIME].sel(scene=scene).max()), notebook_end(data, scene)
    since = {name: better_from(data, scene, name) for name in names}
    true = sorted((name for name, time in since.items() if math.isfinite(time)), key=lambda name: since[name])
    never = [name for name, time in since.items() if math.isinf(time)]
    grown = max(energy_until(data, scene, name, last) / energy_until(data, scene, name, end) - 1.0 for name in names)
    whose = "theirs" if len(names) > 1 else "the other's"
    change = f"has grown by {grown:.0%}" if grown >= UNCHANGED else "has not changed"
    said = f"By t = {last:g} its error is {energy_until(data, scene, SOLVER, last):.0e}, {whose} {change}"
    if true:
        first, *others = true
        said += ": " + joined([
            f"{first} is better from t = {since[first]:.3g} on", *(f"{name} from {since[name]:.3g}" for name in others)
        ])  # fmt: skip
    return said + (f"; {few(never)} {'is' if len(never) == 1 else 'are'} never better." if never else ".")


def long_table(data: xr.Dataset, named: Sequence[str]) -> Table:
    """Energy errors at the notebook's end and far beyond it, and from when on a variant keeps the energy better."""
    last, lines = float(data[Column.LONG_TIME].max()), []
    for scene in map(str, data["scene"].values):
        end = notebook_end(data, scene)
        for name in (row for row in (SOLVER, *named) if row in data["variant"].values):
            since = better_from(data, scene, name)
            better = "" if name == SOLVER else f"{since:.3g}" if math.isfinite(since) else "not to the end"
            errors = (energy_until(data, scene, name, time) for time in (end, last))
            lines.append([scene, name, f"{end:g}", *(f"{error:.0e}" for error in errors), better])
    header = ["scene", "variant", "notebook's end (s)", "energy error to then", f"to t = {last:g}", "better from t (s)"]
    title = (
        f"Energy of {SOLVER} at tolerance {SOLVER_TOLERANCE:g} and of methods of order two at {STEPS_A_NUTATION:.0f} "
        "steps a nutation"
    )
    return Table(title, header, lines)
