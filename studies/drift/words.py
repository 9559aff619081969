"""Tables of the study, and the sentences of its captions and its verdict."""

import math
from collections.abc import Mapping, Sized
from itertools import product

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.run.long_run import PER_NUTATION, SAMPLES
from symtop.runner.study import Table

from .long_runs import PLAIN_MEMBERS
from .messages import strayed
from .phase_loss import LOST, SHORT, TARGET
from .rows import charts_apart, setting, used, without_repeats
from .tables import FAILED, HISTORIES, HORIZONS, ROUNDINGS, WINDOWS, by_integrator, losses, rounding, worst_behaviour

QUOTED = (  # whose exponents the caption quotes
    "stormer-verlet[angles]", "rk4[angles]", "rk4[axis]", "rk45-compiled[angles]", "taylor[axis]",
)  # fmt: skip
FULL_LENGTH = 0.99  # of the longest run of a scene: a shorter run is named
SEEN_PHASE = 1e-11  # rad
ROUNDED_PHASE = 1e-9  # rad: symplectic methods of order 8 reach 4.6e-10 in a million steps, by rounding
PHASE_SLACK = 0.1  # of an exponent
CLOSE = 0.1  # a prediction that is further off, relative, counts as missed
ROUNDING_COLUMNS = {  # header: variable
    "exponent": "exponent",
    "+- (95 %)": "exponent_interval",
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
    made = [_residual_table(groups[HISTORIES])] if HISTORIES in groups else []
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
    header, rows = ["scene", "row", "step or tolerance", "nutations", "outcome"], []
    for name in CONSTANTS:
        header += [f"largest {name} residual", f"trend of {name} over the run", f"exponent, law of {name}"]
    for scene, integrator in product(histories["scene"].values, histories["integrator"].values):
        cell = histories.sel(scene=scene, integrator=integrator)
        row = [str(scene), str(integrator), used(cell), f"{cell['nutations']:.4g}", str(cell["outcome"].item())]
        for name in CONSTANTS:
            doubt = cell[f"{name}_interval"] * cell["sample_time"].max()  # 95 %, of the rise over the whole run
            trend = f"{_number(cell[f'{name}_rise'])} +- {_number(doubt)}"
            row += [_number(cell[f"{name}_largest"]), trend, law(cell, name)]
        rows.append([*row, law(cell, "phase")])
    title = "Relative residuals, linear trends with 95 % intervals, growth ~ t^exponent, its law and where it changes"
    return Table(title, [*header, "exponent, law of phase"], rows)


def _number_table(title: str, runs: Mapping[str, xr.Dataset], columns: Mapping[str, str], form: str) -> Table:
    rows = [[name, *(format(cell[column], form) for column in columns.values())] for name, cell in runs.items()]
    return Table(title, ["row", *columns], rows)


def _scene(group: xr.Dataset) -> str:
    return str(group["scene"].values[0])


def _number(value: xr.DataArray) -> str:
    return f"{value:.2e}" if np.isfinite(value) else ""


def _exponent(cell: xr.Dataset, name: str) -> str:
    return f"{cell[f'{name}_exponent']:.2f} +- {cell[f'{name}_exponent_interval']:.2f}"


def law(cell: xr.Dataset, name: str) -> str:
    """The growth exponent with its interval, the law it agrees with, and where another one gave way to it.

    A change of law is told only above rounding: a single walk of rounding bends anywhere. A drift of the energy is what
    bends the phase.
    """
    if not np.isfinite(cell[f"{name}_exponent"]):
        return ""
    above_rounding = float(cell[f"{'energy' if name == 'phase' else name}_largest"]) > rounding(cell, name)
    time, before, after = (cell[f"{name}_{part}"] for part in ("change", "before", "after"))
    changes = np.isfinite(time) and above_rounding
    change = f"; t^{before:.2f} to t^{after:.2f} at t = {time:.3g}" if changes else ""
    word = cell[f"{name}_law"].item() if name == "phase" or above_rounding else "at rounding"
    return f"{_exponent(cell, name)}, {word}{change}"


def holding(histories: xr.Dataset) -> str:
    """Integrators whose energy error is at rounding or bounded on every scene."""
    names = [str(name) for name in histories["integrator"].values]
    behaviours = {name: worst_behaviour(histories.sel(integrator=name), "energy") for name in names}
    return ", ".join(name for name, word in behaviours.items() if word in ("kept", "bounded")) or "none"


def phase_growth(histories: xr.Dataset) -> list[str]:
    """By what power of time the phase error grows, from the measured exponents: as t, or faster.

    It grows as t if the interval of the exponent, or `PHASE_SLACK`, reaches 1 on every scene, and faster if it lies
    above 1 by more on every scene. Phases below `SEEN_PHASE` are left out.
    """
    steady, faster, unclear = [], [], []
    for name in map(str, histories["integrator"].values):
        cell = histories.sel(integrator=name)
        seen = cell["phase_largest"].values > SEEN_PHASE
        sizes, slopes, doubts = (
            cell[f"phase_{part}"].values[seen] for part in ("largest", "exponent", "exponent_interval")
        )
        if not slopes.size or not np.isfinite(slopes).all():
            continue
        powers = " and ".join(dict.fromkeys(f"t^{slope:.2f}" for slope in slopes))
        entry, doubt = (
            (float(sizes.max()), f"{name} ({powers}, to {sizes.max():.1g} rad)"),
            np.maximum(doubts, PHASE_SLACK),
        )
        if np.all(np.abs(slopes - 1.0) <= doubt):
            steady.append(name)
        else:
            (faster if np.all(slopes - doubt > 1.0) else unclear).append(entry)
    sentences = [f"The phase error grows as t with {', '.join(steady)}."] if steady else []
    if faster:
        listed = ", ".join(text for _, text in sorted(faster, reverse=True))
        sentences.append(f"It grows faster than t, as it does if the energy drifts, with {listed}.")
    if unclear:
        listed = ", ".join(text for _, text in sorted(unclear, reverse=True))
        sentences.append(f"One law on all scenes was not found for {listed}.")
    if any(size < ROUNDED_PHASE for size, _ in faster + unclear):
        sentences.append(
            f"Below {ROUNDED_PHASE:g} rad rounding alone does this: a random walk of the energy makes a phase that "
            "grows as t^3/2."
        )
    return sentences


def quoted(histories: xr.Dataset) -> str:
    """The exponents of a few integrators on the first scene."""
    runs = by_integrator(histories)
    parts = [f"{name}: energy {_exponent(runs[name], 'energy')} and phase {_exponent(runs[name], 'phase')}."
             for name in QUOTED if name in runs]  # fmt: skip
    return " ".join([f"On {histories['scene'].values[0]},", *parts]) if parts else ""


def shortened(histories: xr.Dataset) -> str:
    """Which rows ran over a part of the horizon only, with its share of the longest run; empty if none did."""
    ends = histories["sample_time"].max("sample")
    shares = (ends / ends.max("integrator")).min("scene").to_series()
    shares = shares[shares < FULL_LENGTH].sort_values(ascending=False, kind="stable")
    listed = ", ".join(f"{name} {100.0 * share:.2g} %" for name, share in shares.items())
    return f"To save time, some ran over a part of the horizon only and are judged on it: {listed}." if listed else ""


def moved(windows: xr.Dataset) -> str:
    """How far the means of the energies in a window move from the first to the last, at most over the integrators."""
    full = windows.dropna("window", how="all", subset=["energy_mean"])
    first, last = full.isel(window=0), full.isel(window=-1)
    modified = np.abs(last["modified_energy_mean"] - first["modified_energy_mean"])
    end, most = strayed(windows)
    return (
        f"the mean energy moves by at most {end:.0e} of the width of its oscillation from the first window to the "
        f"last, and by at most {most:.0e} to any other, because short windows hold no whole number of oscillations and "
        f"the {SAMPLES} samples of a longer one may beat with them; the mean modified energy moves from the first "
        f"window to the last by at most {float(modified.max()):.0e} of the energy of the nutation."
    )


def walk(name: str, cell: xr.Dataset) -> str:
    """How the drift by rounding of one method grows, and what compensated sums gain."""
    agrees = abs(cell["exponent"] - 0.5) <= cell["exponent_interval"]
    return (
        f"{name} drifts as n^{cell['exponent']:.2f} +- {cell['exponent_interval']:.2f} "
        f"({'agrees' if agrees else 'does not agree'} with the 1/2 of a random walk); over the last decade of steps it "
        f"is {cell['late']:.1e}, and {cell['plain_late']:.1e} from the same starts with plain sums, "
        f"{cell['plain_late'] / cell['late']:.0f} times more."
    )


def predictions(runs: Mapping[str, xr.Dataset]) -> str:
    """Which losses of phase were predicted, and which were not."""
    off = {name: abs(float(cell["ratio"]) - 1.0) for name, cell in runs.items()}  # NaN: not reached
    times = [float(cell["measured"] / cell["short"]) for name, cell in runs.items() if math.isfinite(off[name])]
    hits = [100.0 * error for error in off.values() if error <= CLOSE]
    missed = [f"{name} ({f'{error:.0%} off' if math.isfinite(error) else 'not reached'})"
              for name, error in off.items() if not error <= CLOSE]  # fmt: skip
    text = (
        f"The steps are chosen so that it comes at about {TARGET / SHORT:g} times the run that predicts it (median "
        f"{np.median(times or math.nan):.2g})."
    )
    if hits:
        text += f" The prediction is right to {max(hits):.2g} % for {len(hits)} of {len(off)} rows."
    return text + (f" Off by more than {CLOSE:.0%}: {', '.join(missed)}." if missed else "")


LOSING = {"drift": "drifts", "growing": "grows by no single law", "random walk": "walks randomly"}


def verdict(data: xr.DataTree) -> list[str]:
    """Which methods conserve what, and at what rate the others lose it."""
    groups = {name: group.to_dataset() for name, group in data.children.items()}
    sentences, part = [], ""
    if HISTORIES in groups:
        told = without_repeats(groups[HISTORIES])
        sentences = [sentence for name in CONSTANTS for sentence in _constant_sentences(told, name)]
        sentences += phase_growth(told)
        part = shortened(told)
        sentences = list(filter(None, [setting(told), *sentences, charts_apart(groups[HISTORIES])]))
    if WINDOWS in groups:
        steps, names = float(groups[WINDOWS]["steps"].max()), groups[WINDOWS]["integrator"].values
        of = f"{', '.join(names)}, {PER_NUTATION:.0f} a nutation of {_scene(groups[WINDOWS])},"
        sentences.append(f"Over {steps:.0e} steps of {of} {moved(groups[WINDOWS])}")
    if ROUNDINGS in groups:
        sentences += [f"Rounding: {walk(name, cell)}" for name, cell in by_integrator(groups[ROUNDINGS]).items()]
    if HORIZONS in groups:
        predicted = predictions(losses(groups[HORIZONS]))
        on = _scene(groups[HORIZONS])
        sentences.append(f"Time until the phase error reaches {LOST:g} rad on {on}: {predicted}")
    return [*sentences, part] if part else sentences


def counted(rows: Sized) -> str:
    """How many rows, in words."""
    return f"{len(rows)} row{'' if len(rows) == 1 else 's'}"


def _constant_sentences(histories: xr.Dataset, name: str) -> list[str]:
    groups: dict[str, list[tuple[float, str, float]]] = {}  # (largest residual, integrator, exponent) by behaviour
    for integrator in histories["integrator"].values:
        cell = histories.sel(integrator=integrator)
        worst, rate = (float(cell[f"{name}_{part}"].max()) for part in ("largest", "exponent"))
        groups.setdefault(worst_behaviour(cell, name), []).append((worst, str(integrator), rate))
    sentences = []
    if kept := groups.get("kept"):
        sentences.append(f"{name} stays at rounding with {counted(kept)} (at most {max(kept)[0]:.1e}).")
    if held := groups.get("bounded"):
        (least, best, _), (most, last, _) = min(held), max(held)
        span = f"from {least:.1e} ({best}) to {most:.1e} ({last})" if len(held) > 1 else f"{most:.1e} ({last})"
        sentences.append(f"{name} has a bounded error with {counted(held)}, {span}.")
    for word, verb in LOSING.items():
        if lost := groups.get(word):
            listed = ", ".join(f"{one} (to {worst:.1e}, as t^{rate:.2f})" for worst, one, rate in sorted(lost))
            sentences.append(f"{name} {verb} with {listed}.")
    if failed := groups.get(FAILED):
        sentences.append(f"Runs of {', '.join(one for _, one, _ in failed)} ended early.")
    return sentences
