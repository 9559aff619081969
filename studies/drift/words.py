"""Tables of the study, and the sentences of its captions and its verdict."""

import math
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import xarray as xr
from symtop_studies.drift.runs import PLAIN_MEMBERS

from symtop.measure.conservation import CONSTANTS
from symtop.report.sentences import counted, few
from symtop.run.long_run import PER_NUTATION, SAMPLES
from symtop.runner.study import Table

from . import behaviours
from .messages import strayed
from .phase_loss import LOST
from .tables import HISTORIES, HORIZONS, ROUNDINGS, WINDOWS, by_integrator, losses, rounding, worst_behaviour
from .variants import charts_apart, charts_table, setting, used, without_repeats

CLOSE = 0.1  # a prediction that is further off, relative, counts as missed
ROUNDING_COLUMNS = {  # header: variable
    "exponent": "exponent",
    "+- (95%)": "exponent_interval",
    "late drift": "late",
    "exponent, plain sums": "plain_exponent",
    "late drift, plain sums": "plain_late",
    "plain / compensated late drift": "gain",
    "largest change of p_phi": "p_phi",
    "largest change of p_psi": "p_psi",
}
HORIZON_COLUMNS = {
    "steps a nutation": "steps", "predicted": "predicted", "measured": "measured", "predicted / measured": "ratio",
}  # fmt: skip


def tables(data: xr.DataTree) -> list[Table]:
    """Largest residuals, trends and growth exponents; drift by rounding; losses of phase."""
    groups = {name: group.to_dataset() for name, group in data.children.items()}
    made: list[Table] = []
    if HISTORIES in groups:
        made += behaviours.tables(without_repeats(groups[HISTORIES]))
        made += [*charts_table(groups[HISTORIES]), _residual_table(groups[HISTORIES])]
    if ROUNDINGS in groups:
        title = (
            f"Rounding near {_scene(groups[ROUNDINGS])}, {PER_NUTATION:.0f} steps a nutation: drift of the modified "
            "energy of an ensemble (late: rms over the last decade of steps of the "
            f"{PLAIN_MEMBERS} starts that ran with both sums)"
        )
        made.append(_number_table(title, by_integrator(groups[ROUNDINGS]), ROUNDING_COLUMNS, ".2g"))
    if HORIZONS in groups:
        title = f"Nutations until the phase error reaches {LOST:g} rad on {_scene(groups[HORIZONS])}"
        made.append(_number_table(title, losses(groups[HORIZONS]), HORIZON_COLUMNS, ".6g"))
    return made


def _residual_table(histories: xr.Dataset) -> Table:
    header, rows = ["scene", "variant", "step or tolerance", "nutations", "outcome"], []
    for name in CONSTANTS:
        header += [f"largest {name} residual", f"trend of {name} over the run", f"exponent, law of {name}"]
    ends = histories["sample_time"].max("sample")
    histories = histories.drop_dims("sample")  # a cell is chosen of the few numbers of a run, not of its series
    for scene, integrator in product(histories["scene"].values, histories["variant"].values):
        cell, end = (part.sel(scene=scene, variant=integrator) for part in (histories, ends))
        row = [str(scene), str(integrator), used(cell), f"{cell['nutations']:.4g}", str(cell["outcome"].item())]
        for name in CONSTANTS:
            doubt = cell[f"{name}_interval"] * end  # 95%, of the rise over the whole run
            trend = f"{_number(cell[f'{name}_rise'])} +- {_number(doubt)}"
            row += [_number(cell[f"{name}_largest"]), trend, law(cell, name)]
        rows.append([*row, law(cell, "phase")])
    title = "Relative residuals, linear trends with 95% intervals, growth ~ t^exponent, its law and where it changes"
    return Table(title, [*header, "exponent, law of phase"], rows)


def _number_table(title: str, runs: Mapping[str, xr.Dataset], columns: Mapping[str, str], form: str) -> Table:
    rows = [
        [name, *(format(cell[column], form) if math.isfinite(cell[column]) else "" for column in columns.values())]
        for name, cell in runs.items()
    ]
    return Table(title, ["variant", *columns], rows)


def _scene(group: xr.Dataset) -> str:
    return str(group["scene"].values[0])


def _number(value: xr.DataArray) -> str:
    return f"{value:.2e}" if math.isfinite(value) else ""


def _exponent(cell: xr.Dataset, name: str) -> str:
    return f"{cell[f'{name}_exponent']:.2f} +- {cell[f'{name}_exponent_interval']:.2f}"


def law(cell: xr.Dataset, name: str) -> str:
    """The growth exponent with its interval, the law it agrees with, and where another one gave way to it.

    A change of law is told only above rounding: a single walk of rounding bends anywhere. A drift of the energy is what
    bends the phase.
    """
    if not math.isfinite(cell[f"{name}_exponent"]):
        return ""
    above_rounding = float(cell[f"{'energy' if name == 'phase' else name}_largest"]) > rounding(cell, name)
    time, before, after = (cell[f"{name}_{part}"] for part in ("change", "before", "after"))
    changes = math.isfinite(time) and above_rounding
    change = f"; t^{before:.2f} to t^{after:.2f} at t = {time:.3g}" if changes else ""
    word = cell[f"{name}_law"].item() if name == "phase" or above_rounding else "at rounding"
    return f"{_exponent(cell, name)}, {word}{change}"


def holding(histories: xr.Dataset) -> list[str]:
    """Integrators whose energy error is at rounding or bounded on every scene."""
    names = [str(name) for name in histories["variant"].values]
    fates = {name: worst_behaviour(histories.sel(variant=name), "energy") for name in names}
    return [name for name, word in fates.items() if word in ("kept", "bounded")]


def shortened(histories: xr.Dataset) -> str:
    """How many variants ran over a part of the horizon only, with its share of the longest run; empty if none did."""
    every = behaviours.run_shares(histories)
    shorter = {row: share for row, share in every.items() if share < behaviours.FULL_LENGTH}
    if not shorter:
        return ""
    names = sorted(shorter, key=lambda row: -shorter[row])
    least, most = (f"{100.0 * shorter[row]:.2g}%" for row in (names[-1], names[0]))
    part = most if least == most else f"{least} ({names[-1]}) to {most}"
    return f"To save time, {few(names)} ran over {part} of the horizon only, and are judged on that part."


def moved(windows: xr.Dataset) -> str:
    """How far the means of the energies in a window move from the first to the last, at most over the integrators."""
    full = windows.dropna("window", how="all", subset=["energy_mean"])
    first, last = full.isel(window=0), full.isel(window=-1)
    modified = np.abs(last["modified_energy_mean"] - first["modified_energy_mean"])
    return (
        f"the mean energy moves by at most {strayed(windows)[0]:.0e} of the width of its oscillation from the first "
        f"window to the last; the mean modified energy by at most {float(modified.max()):.0e} of the energy of the "
        "nutation."
    )


def scatter(windows: xr.Dataset) -> str:
    """How far the mean energy of any window is from that of the first, and why."""
    return (
        f"Between them the mean is off by up to {strayed(windows)[1]:.0e} of that width: a short window holds no "
        f"whole number of oscillations, and the {SAMPLES} samples of a long one may beat with them."
    )


def walks(ensembles: Mapping[str, xr.Dataset]) -> str:
    """How the drift by rounding grows with several methods, and what compensated sums gain."""
    powers, gains = ([float(cell[name]) for cell in ensembles.values()] for name in ("exponent", "gain"))
    agreeing = sum(
        abs(float(cell["exponent"]) - 0.5) <= float(cell["exponent_interval"]) for cell in ensembles.values()
    )
    return (
        f"Rounding makes the modified energy drift as n^{min(powers):.2f} to n^{max(powers):.2f} in n steps; with "
        f"{agreeing} of {counted(len(powers))} that agrees with the 1/2 of a random walk. Plain sums instead of "
        f"compensated ones drift {min(gains):.0f} to {max(gains):.0f} times as far."
    )


def predictions(runs: Mapping[str, xr.Dataset], place: str = "", left: Sequence[str] = ()) -> str:
    """Which losses of phase were predicted, and which were not; nothing was foretold of the variants `left`."""
    off = {name: abs(float(cell["ratio"]) - 1.0) for name, cell in runs.items()}  # NaN: not reached
    times = [float(cell["measured"] / cell["short"]) for name, cell in runs.items() if math.isfinite(off[name])]
    hits = [100.0 * error for error in off.values() if error <= CLOSE]
    missed = [f"{name} ({error:.0%} off)" for name, error in off.items() if error > CLOSE]
    never = [name for name, error in off.items() if math.isnan(error)]
    if not runs:
        return ""
    short = max(float(cell["short"]) for cell in runs.values())
    text = (
        f"A run of {short:g} nutations predicts when the phase error reaches {LOST:g} rad{place}"
        f"{f', {np.median(times):.2g} times as late in the median' if times else ''}"
    )
    if hits:
        text += f": right to {max(hits):.2g}% for {len(hits)} of {counted(len(off))}"
    rest = (f" Off by more than {CLOSE:.0%}: {few(missed)}.", f" Not reached by the end of a run: {few(never)}.",
            f" No prediction was possible for: {few(list(left))}.")  # fmt: skip
    return f"{text}." + "".join(said for said, rows in zip(rest, (missed, never, left), strict=True) if rows)


def verdict(data: xr.DataTree) -> list[str]:
    """Which methods conserve what, and at what rate the others lose it."""
    groups = {name: group.to_dataset() for name, group in data.children.items()}
    sentences, held = [], []
    if HISTORIES in groups:
        told = without_repeats(groups[HISTORIES])
        sentences = [behaviours.constant_sentence(told, name) for name in CONSTANTS]
        sentences += [
            behaviours.phase_sentence(told),
            behaviours.faster_sentence(told),
            charts_apart(groups[HISTORIES]),
        ]
        held = [setting(told), shortened(told)]
    if WINDOWS in groups:
        steps, names = float(groups[WINDOWS]["steps"].max()), list(map(str, groups[WINDOWS]["variant"].values))
        ran = f"{few(names)} ran {steps:.0e} steps, {PER_NUTATION:.0f} a nutation of {_scene(groups[WINDOWS])}."
        sentences.append(f"{ran} {moved(groups[WINDOWS]).capitalize()}")
    if ROUNDINGS in groups:
        sentences.append(walks(by_integrator(groups[ROUNDINGS])))
    if HORIZONS in groups:
        foretold = losses(groups[HORIZONS])
        left = [name for name in map(str, groups[HORIZONS]["variant"].values) if name not in foretold]
        sentences.append(predictions(foretold, f" on {_scene(groups[HORIZONS])}", left))
    return list(filter(None, [*sentences, *held]))
