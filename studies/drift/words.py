"""Captions, tables and sentences of the study."""

import math
from collections.abc import Callable

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.run.long_run import PER_NUTATION
from symtop.runner.study import Table

from .long_runs import Rounding
from .phase_loss import LOST, SHORT, TARGET, PhaseLoss
from .tables import (
    CLOSE,
    FAILED,
    HISTORIES,
    HORIZONS,
    ROUNDED,
    ROUNDINGS,
    WINDOWS,
    Quantity,
    band,
    cells,
    moved,
    phase_losses,
    predictions,
    quantity,
    roundings,
    shortened,
    worst_behaviour,
)

QUOTED = ("stormer-verlet", "rk4", "rk45-compiled")  # whose exponents the caption quotes


def number(value: float) -> str:
    """Three figures; empty for no number."""
    return f"{value:.2e}" if np.isfinite(value) else ""


def law(of: Quantity, *, above_rounding: bool) -> str:
    """The growth exponent with its interval, the law it agrees with, and where another one gave way to it.

    A change of law is told only above rounding: a single walk of rounding bends anywhere.
    """
    growth = of.growth
    if not np.isfinite(growth.exponent):
        return ""
    changes = np.isfinite(growth.change) and above_rounding
    change = f"; t^{growth.before:.2f} to t^{growth.after:.2f} at t = {growth.change:.3g}" if changes else ""
    return f"{growth.exponent:.2f} +- {growth.exponent_interval:.2f}, {growth.law}{change}"


# ---- tables: a header and the text of its cell for each column -------------------------------------------------------

RESIDUAL_COLUMNS: dict[str, Callable[[Quantity], str]] = {
    "largest {} residual": lambda of: number(of.growth.largest),
    "trend of {} over the run": lambda of: f"{number(of.trend.rise)} +- {number(of.doubt)}",
    "exponent, law of {}": lambda of: law(of, above_rounding=of.growth.largest > ROUNDED),
}
ROUNDING_COLUMNS: dict[str, Callable[[Rounding], float]] = {
    "exponent": lambda of: of.exponent,
    "+- (95 %)": lambda of: of.exponent_interval,
    "drift at the end": lambda of: of.end,
    "exponent, plain sums": lambda of: of.plain_exponent,
    "drift at the end, plain sums": lambda of: of.plain_end,
    "plain / compensated drift, same starts": lambda of: of.gain,
    "largest change of p_phi": lambda of: of.p_phi,
    "largest change of p_psi": lambda of: of.p_psi,
}
HORIZON_COLUMNS: dict[str, Callable[[PhaseLoss], float]] = {
    "steps a nutation": lambda of: of.steps,
    "predicted": lambda of: of.predicted,
    "measured": lambda of: of.measured,
    "predicted / measured": lambda of: of.ratio,
}


def tables(data: xr.DataTree) -> list[Table]:
    """Largest residuals, trends and growth exponents; drift by rounding; losses of phase."""
    made = {HISTORIES: _residual_table, ROUNDINGS: _rounding_table, HORIZONS: _horizon_table}
    return [table(data[group].to_dataset()) for group, table in made.items() if group in data]


def _residual_table(data: xr.Dataset) -> Table:
    columns = [(name, header, text) for name in CONSTANTS for header, text in RESIDUAL_COLUMNS.items()]
    rows = []
    for scene, name, cell in cells(data):
        moves = quantity(cell, "energy").growth.largest > ROUNDED  # the energy's drift is what bends the phase
        rows.append([
            scene,
            name,
            str(cell["outcome"].item()),
            *(text(quantity(cell, constant)) for constant, _, text in columns),
            law(quantity(cell, "phase"), above_rounding=moves),
        ])  # fmt: skip
    headers = [header.format(name) for name, header, _ in columns]
    return Table(
        "Relative residuals, linear trends with 95 % intervals, growth ~ t^exponent, its law and where it changes",
        ["scene", "integrator", "outcome", *headers, "exponent, law of phase"],
        rows,
    )


def _rounding_table(data: xr.Dataset) -> Table:
    rows = [[name, *(f"{of(one):.2g}" for of in ROUNDING_COLUMNS.values())] for name, one in roundings(data).items()]
    return Table("Rounding: drift of the modified energy of an ensemble", ["integrator", *ROUNDING_COLUMNS], rows)


def _horizon_table(data: xr.Dataset) -> Table:
    rows = [[name, *(f"{of(one):.6g}" for of in HORIZON_COLUMNS.values())] for name, one in phase_losses(data).items()]
    return Table(f"Nutations until the phase error reaches {LOST:g} rad", ["integrator", *HORIZON_COLUMNS], rows)


# ---- captions --------------------------------------------------------------------------------------------------------


def residuals(data: xr.Dataset) -> str:
    """Caption of the residuals of some integrators over time."""
    behaviours = {str(name): worst_behaviour(data.sel(integrator=name), "energy") for name in data["integrator"].values}
    holding = [name for name, word in behaviours.items() if word in ("kept", "bounded")]
    return (
        "Relative change of energy and of both momenta since the start: samples as dots, the largest of each time "
        "window as a line with markers, at 1e-17 if smaller; the dashed line rises as t. On every scene the energy "
        "error is at rounding or bounded (growth exponent nearest to 0, 95 % interval below 1/2) for "
        f"{', '.join(holding) or 'none'}. The momenta are recomputed from the increments of the trajectory. "
        f"{_shortened_words(data)}"
    ).rstrip()


def sizes(data: xr.Dataset) -> str:
    """Caption of the largest residuals."""
    return (
        "Largest relative residual of every method over the whole run; an exact zero is drawn at 1e-17. A million "
        f"steps of rounding explain changes up to {ROUNDED:.0e}: what a method conserves lies below. What it does not "
        "conserve shows the truncation error of a step, or, farthest to the right, a drift. "
        f"{_shortened_words(data)}"
    ).rstrip()


def exponents(data: xr.Dataset) -> str:
    """Caption of the growth exponents."""
    first = data["scene"].values[0]
    quoted = []
    for name in QUOTED:
        if name in data["integrator"].values:
            cell = data.sel(integrator=name, scene=first)
            growths = {of: quantity(cell, of).growth for of in ("energy", "phase")}
            parts = [f"{of} {one.exponent:.2f} +- {one.exponent_interval:.2f}" for of, one in growths.items()]
            quoted.append(f"{name}: {' and '.join(parts)}.")
    return (
        "Growth exponents of the largest residual of energy and momenta, over the last two decades of time, and of the "
        "phase error of the nutation, over the last one, with 95 % intervals. 0 is a bounded error, 1/2 the random "
        "walk of rounding, 1 a steady drift, 2 the phase error under a drifting energy. "
        f"{f'On {first}, ' + ' '.join(quoted) if quoted else ''} {_shortened_words(data)}"
    ).rstrip()


def windows(data: xr.Dataset) -> str:
    """Caption of the windows of the long runs."""
    runs = cells(data)
    changes = [band(cell, name) for _, _, cell in runs for name in ("p_phi", "p_psi")]
    worst = max(float(np.nanmax(np.abs([one.least, one.largest]))) for one in changes)
    energy, modified = moved(data)
    return (
        f"{float(data['steps'].max()):.0e} steps on {', '.join(dict.fromkeys(scene for scene, _, _ in runs))}, "
        f"{PER_NUTATION:.0f} a nutation: the band reaches from the least to the largest relative change in each "
        "window, the line is its mean. The modified energy is the energy with the h^2 term of the discrete motion, "
        "less the oscillation of order h^4 that remains. From the first window to the last the mean energy moves by at "
        f"most {energy:.0e} of the width of its band, and the mean modified energy by at most {modified:.0e} of the "
        f"energy's scale. The momenta, recomputed inside the step, stay within {worst:.0e}."
    )


def rounding(data: xr.Dataset) -> str:
    """Caption of the drift by rounding."""
    return (
        "Drift of the modified energy by rounding: each start as a thin line, their root mean square with markers, and "
        "dashed that of the same kernels with plain sums. "
        f"{' '.join(walk_words(name, ensemble) for name, ensemble in roundings(data).items())}"
    )


def horizons(data: xr.Dataset) -> str:
    """Caption of the losses of phase."""
    return (
        "Phase error of the nutation of every fixed-step method, each with a step of its own. The time at which it "
        f"reaches {LOST:g} rad (line) is predicted from the grey part and then measured. "
        f"{prediction_words(phase_losses(data))}"
    )


# ---- sentences -------------------------------------------------------------------------------------------------------


def walk_words(name: str, ensemble: Rounding) -> str:
    """How the drift by rounding of one method grows, and what compensated sums gain."""
    slope, doubt = ensemble.exponent, ensemble.exponent_interval
    walk = "agrees" if abs(slope - 0.5) <= doubt else "does not agree"
    return (
        f"{name} drifts as n^{slope:.2f} +- {doubt:.2f} ({walk} with the 1/2 of a random walk), to {ensemble.end:.1e}, "
        f"{ensemble.gain:.0f} times less than with plain sums."
    )


def prediction_words(losses: dict[str, PhaseLoss]) -> str:
    """Who was predicted when it loses its phase, and who was not."""
    seen = predictions(losses)
    sentence = (
        f"The steps are chosen so that it comes at about {TARGET / SHORT:g} times the run that predicts it (median "
        f"{seen.median:.2g})."
    )
    if seen.hits:
        worst = 100.0 * max(seen.hits.values())
        sentence += f" The prediction is right to {worst:.2g} % for {len(seen.hits)} of {len(losses)} methods."
    words = {name: f"{off:.0%} off" if math.isfinite(off) else "not reached" for name, off in seen.misses.items()}
    missed = ", ".join(f"{name} ({word})" for name, word in words.items())
    return sentence + (f" Off by more than {CLOSE:.0%}: {missed}." if missed else "")


def _shortened_words(data: xr.Dataset) -> str:
    shares = sorted(shortened(data).items(), key=lambda item: -item[1])
    listed = ", ".join(f"{name} {100.0 * share:.2g} %" for name, share in shares)
    return f"To save time, some ran over a part of the horizon only and are judged on it: {listed}." if listed else ""


LOSING = {"drift": "drifts", "growing": "grows by no single law", "random walk": "walks randomly"}


def verdict(data: xr.DataTree) -> list[str]:
    """Which methods conserve what, and at what rate the others lose it."""
    sentences: list[str] = []
    if HISTORIES in data:
        histories = data[HISTORIES].to_dataset()
        for name in CONSTANTS:
            sentences += _constant_sentences(histories, name)
    if WINDOWS in data:
        sentences.append(_window_sentence(data[WINDOWS].to_dataset()))
    if ROUNDINGS in data:
        walks = roundings(data[ROUNDINGS].to_dataset())
        sentences += [f"Rounding: {walk_words(name, ensemble)}" for name, ensemble in walks.items()]
    if HORIZONS in data:
        losses = phase_losses(data[HORIZONS].to_dataset())
        sentences.append(f"Time until the phase error reaches {LOST:g} rad: {prediction_words(losses)}")
    part = _shortened_words(data[HISTORIES].to_dataset()) if HISTORIES in data else ""
    return [*sentences, part] if part else sentences


def _constant_sentences(histories: xr.Dataset, name: str) -> list[str]:
    groups: dict[str, list[tuple[float, str, float]]] = {}  # (largest residual, integrator, exponent) by behaviour
    for integrator in histories["integrator"].values:
        cell = histories.sel(integrator=integrator)
        worst, rate = (float(cell[f"{name}_{part}"].max()) for part in ("largest", "exponent"))
        groups.setdefault(worst_behaviour(cell, name), []).append((worst, str(integrator), rate))
    sentences = []
    if kept := groups.get("kept"):
        sentences.append(f"{name} stays at rounding with {len(kept)} methods (at most {max(kept)[0]:.1e}).")
    if held := groups.get("bounded"):
        (least, best, _), (most, last, _) = min(held), max(held)
        span = f"from {least:.1e} ({best}) to {most:.1e} ({last})" if len(held) > 1 else f"{most:.1e} ({last})"
        sentences.append(f"{name} has a bounded error with {len(held)} methods, {span}.")
    for word, verb in LOSING.items():
        if lost := groups.get(word):
            listed = ", ".join(f"{one} (to {worst:.1e}, as t^{rate:.2f})" for worst, one, rate in sorted(lost))
            sentences.append(f"{name} {verb} with {listed}.")
    if failed := groups.get(FAILED):
        sentences.append(f"Runs of {', '.join(one for _, one, _ in failed)} ended early.")
    return sentences


def _window_sentence(data: xr.Dataset) -> str:
    energy, modified = moved(data)
    return (
        f"Over {float(data['steps'].max()):.0e} steps of {', '.join(data['integrator'].values)} the mean energy moves "
        f"by at most {energy:.0e} of the width of its oscillation, and the mean modified energy by at most "
        f"{modified:.0e} of the energy's scale."
    )
