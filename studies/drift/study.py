"""What happens to energy, momenta and phase over a million steps, and over 10^8?"""

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS, history
from symtop.measure.growth import behaviour
from symtop.measure.modified_energy import KNOWN
from symtop.methods.registry import integrator, integrators
from symtop.model.scenes import added_scenes, scene
from symtop.report import figures
from symtop.run.long_run import PER_NUTATION, long_windows
from symtop.runner.study import Case, Picture, Study, Table

from . import figures as long_figures
from .horizons import LOST, lost_phase
from .rounding import round_off

SCENES = ["spheroid", "goldstein"]
LONG = "spheroid"  # the scene of the long runs and of the horizons
STEPS_A_NUTATION = 118.02
TOLERANCES = {"rk45": 1e-8, "rk45-compiled": 1e-8}  # 1e-6 for the others
SHORTENED = {"rk45": 0.2, "radau": 0.02, "taylor-quad": 0.005}  # seconds to minutes otherwise
LABELS = {"energy": "energy", "p_phi": r"$p_\varphi$", "p_psi": r"$p_\psi$"}
AHEAD = 2.5  # times the run that foretells: when phase is lost
FORETOLD = 0.1  # a time that is further off was not foretold
PARTS = ("largest", "rise", "interval", "exponent", "exponent_interval")


def cases(quick: bool) -> list[Case]:
    """A million steps of every fixed-step method (and the same horizon of the adaptive ones); horizons; long runs."""
    return _grid(20_000, 2, 100_000, 200_000, 100.0) if quick else _grid(1_000_000, 24, 10_000_000, 100_000_000, 1000.0)


def full() -> list[Case]:
    """An ensemble of 10^8 and a run of 10^9 steps each of four methods."""
    return _grid(1_000_000, 24, 100_000_000, 1_000_000_000, 1000.0)


def _grid(steps: int, members: int, walk: int, longest: int, short: float) -> list[Case]:
    long = [
        case
        for name in ("midpoint", *(other for other in KNOWN if other != "midpoint"))  # the slowest first
        for case in (
            Case(LONG, name, {"part": "long", "steps": longest, "per_nutation": PER_NUTATION}),
            Case(LONG, name, {"part": "rounding", "steps": walk, "per_nutation": PER_NUTATION, "count": members}),
        )
    ]
    lost = [
        Case(LONG, method.name, {"part": "horizon", "short": short, "target": AHEAD * short})
        for method in integrators().values()
        if method.knob == "step_size"
    ]
    histories = [_history(name, method, steps) for name in [*SCENES, *added_scenes()] for method in integrators()]
    return histories + long + lost


def _history(name: str, known: str, steps: int) -> Case:
    method, horizon = integrator(known), steps * scene(name).nutation_period / STEPS_A_NUTATION
    settings = {"part": "history", "samples": 4001 if steps > 100_000 else 601}
    if method.knob == "step_size":
        settings["step_size"] = horizon / steps
    elif method.knob == "tolerance" and method.default_tolerance is None:
        settings["tolerance"] = TOLERANCES.get(known, 1e-6)
    settings["horizon"] = horizon * SHORTENED.get(known, 1.0)
    return Case(name, known, settings)


MEASURES = {"history": history, "horizon": lost_phase, "rounding": round_off, "long": long_windows}


def measure(case: Case) -> xr.Dataset:
    """One part of the study: a history with its growth, a lost phase, an ensemble, or the windows of a long run."""
    settings = dict(case.settings)
    return MEASURES[settings.pop("part")](scene(case.scene), integrator(case.integrator), **settings)


SHOWN = ("midpoint", "trapezoidal", "stormer-verlet", "strang", "gauss-4", "rk4", "rk45", "taylor")


def pictures(data: xr.Dataset) -> list[Picture]:
    """Residuals and their growth for every method; the long runs, the walks of rounding, and the lost phases."""
    scenes = [str(name) for name in data["scene"].values]
    known = [name for name in data["integrator"].values if str(name) in SHOWN]
    shown = data.sel(integrator=known or data["integrator"].values)
    rows = [(name, f"|residual {LABELS[name]}| (relative)") for name in CONSTANTS]
    kinds = {str(name): kind(data.sel(integrator=name), "energy") for name in shown["integrator"].values}
    bounded = [name for name, word in kinds.items() if word in ("kept", "bounded")]
    short = _shortened(data)
    history_ = Picture(
        "residuals",
        figures.residual_history(shown, scenes, rows),
        "Change of energy and of both momenta since the start: single samples as dots, the largest in each window as a "
        "line. Bounded energy on every scene (the growth exponent is nearest to 0 and its 95 % interval excludes 1/2): "
        f"{', '.join(bounded) or 'none'}. The momenta are recomputed from the increments of the trajectory. "
        f"{_shortened(shown)}",
        "Log-log plots of residuals over time, flat for the discrete methods, rising for adaptive Runge-Kutta.",
    )
    columns = [(f"{name}_largest", f"largest residual {LABELS[name]}") for name in CONSTANTS]
    sizes = Picture(
        "sizes",
        figures.dots(data, scenes, columns, log=True),
        "Largest residual of every method over the whole run. Rounding is at 1e-16 (an exact zero is drawn at 1e-17); "
        "what a method keeps stays within "
        f"a few hundred of it, what it does not shows its truncation error, and drifts add up to the right. {short}",
        "Dot plot of largest residuals of energy and momenta for every integrator.",
    )
    growths = Picture(
        "exponents",
        long_figures.exponents(
            data,
            scenes,
            [(f"{name}_exponent", f"exponent of {label}") for name, label in {**LABELS, "phase": "phase"}.items()],
        ),
        "Growth exponent of the largest residual of energy and momenta over the last two decades of time and of the "
        "phase error over the last one, with 95 % intervals: 0 is bounded, 1/2 the random walk of rounding, 1 a steady "
        f"drift, 2 the phase of a drifting energy. {_laws(data)} {short}",
        "Dot plots of growth exponents of energy, momenta and phase for every integrator.",
    )
    here = data.sel(scene=LONG)
    walkers = [str(name) for name in KNOWN if np.isfinite(here["rounding_end"].sel(integrator=name))]
    steps = float(here["window_steps"].max())
    ends = [f"window_{name}_{part}" for name in ("p_phi", "p_psi") for part in ("least", "largest")]
    worst = max(float(np.abs(here[name]).max()) for name in ends)
    moved, wandered = _moved(here.sel(integrator=walkers))
    windows = Picture(
        "windows",
        long_figures.window_bands(here, walkers),
        f"{steps:.0e} steps on {LONG}, {PER_NUTATION:.0f} a nutation: a band from the least to the largest change of "
        f"each window, its mean as a line. From the first window to the last the mean energy moves by {moved:.0e} of "
        f"its band at most, and the mean modified energy by {wandered:.0e}. Momenta, recomputed inside the step, stay "
        f"within {worst:.0e}.",
        "Bands of energy, modified energy and momenta over the logarithm of steps for four methods.",
    )
    walks = Picture(
        "rounding",
        long_figures.walks(here, walkers),
        "Drift of the modified energy by rounding: each start thin, their root mean square with markers, and that of "
        f"the same kernels with plain sums dashed. {' '.join(_walk(here.sel(integrator=name)) for name in walkers)}",
        "Log-log plots of the drift by rounding over steps for four methods, compensated and plain.",
    )
    lost = Picture(
        "horizons",
        long_figures.lost_phases(here, LOST),
        "Phase error of the nutation of every fixed-step method, each with a step of its own. When it reaches "
        f"{LOST:g} rad is foretold from the grey part and then measured. {_horizons(here)}",
        "Phase errors rising to a tolerance, foretold and measured times of reaching it, their difference in percent.",
    )
    return [history_, sizes, growths, windows, walks, lost]


def _moved(cells: xr.Dataset) -> tuple[float, float]:
    """How far the mean of a window went by the last one: energy in widths of its band, modified energy relative."""
    full = cells.dropna("window", how="all", subset=["window_energy_mean"])
    went = [
        np.abs(full[f"window_{name}_mean"].isel(window=-1) - full[f"window_{name}_mean"].isel(window=0))
        for name in ("energy", "modified_energy")
    ]
    band = (full["window_energy_largest"] - full["window_energy_least"]).isel(window=0)
    return float((went[0] / band).max()), float(went[1].max())


def _walk(cell: xr.Dataset) -> str:
    name, ratio = str(cell["integrator"].values), float(cell["rounding_gain"])
    slope, doubt = float(cell["rounding_exponent"]), float(cell["rounding_exponent_interval"])
    said = f"{name} grows as n^{slope:.2f} +- {doubt:.2f}"
    walk = "agrees" if abs(slope - 0.5) <= doubt else "does not agree"
    return (
        f"{said} ({walk} with a walk's 1/2), to {float(cell['rounding_end']):.1e}, "
        f"{ratio:.0f} times less than plain sums."
    )


def _horizons(here: xr.Dataset) -> str:
    """Who was foretold when it loses its phase, to `FORETOLD`, and who was not."""
    asked = here["integrator"].values[np.isfinite(here["horizon_predicted"].values)]
    off = {str(name): abs(float(here["horizon_ratio"].sel(integrator=name)) - 1.0) for name in asked}
    good = [share for share in off.values() if share <= FORETOLD]
    bad = [f"{name} ({f'{share:.0%} off' if np.isfinite(share) else 'not reached'})" for name, share in off.items()
           if not share <= FORETOLD]  # fmt: skip
    told = here.sel(integrator=asked)
    times = float((told["horizon_measured"] / told["horizon_short"]).median())
    said = f"Steps were chosen so that the loss comes at {AHEAD:g} times the foretelling run (median {times:.2g})."
    if good:
        said += f" It was foretold to {100.0 * max(good):.2g} % for {len(good)} of {len(off)} methods."
    return said + (f" Not foretold: {', '.join(bad)}." if bad else "")


def _laws(data: xr.Dataset) -> str:
    said = []
    for name in ("stormer-verlet", "rk4", "rk45-compiled"):
        if name in data["integrator"].values:
            cell = data.sel(integrator=name, scene=data["scene"].values[0])
            parts = [
                f"{q} {float(cell[f'{q}_exponent']):.2f} +- {float(cell[f'{q}_exponent_interval']):.2f}"
                for q in ("energy", "phase")
            ]
            said.append(f"{name}: {' and '.join(parts)}.")
    return f"On {data['scene'].values[0]}, " + " ".join(said) if said else ""


def _law(cell: xr.Dataset, quantity: str) -> str:
    """The exponent with its interval, the law it agrees with, and where another one gave way to it."""
    slope, doubt, change, before, after = (
        float(cell[f"{quantity}_{part}"]) for part in ("exponent", "exponent_interval", "change", "before", "after")
    )
    if not np.isfinite(slope):
        return ""
    size = float(cell[f"{'energy' if quantity == 'phase' else quantity}_largest"])
    turns = np.isfinite(change) and size > ROUNDING  # a single walk of rounding bends anywhere
    turn = f"; t^{before:.2f} to t^{after:.2f} at t = {change:.3g}" if turns else ""
    return f"{slope:.2f} +- {doubt:.2f}, {cell[f'{quantity}_law'].item()}{turn}"


def _number(value: float) -> str:
    return f"{value:.2e}" if np.isfinite(value) else ""


def tables(data: xr.Dataset) -> list[Table]:
    """Largest residuals, trends and growth exponents; walks of rounding; lost phases."""
    rows = []
    for name in data["scene"].values:
        for method in data["integrator"].values:
            cell = data.sel(scene=name, integrator=method)
            row = [str(name), str(method), str(cell["outcome"].item())]
            for quantity in CONSTANTS:
                values = {part: float(cell[f"{quantity}_{part}"]) for part in PARTS}
                doubt = values["interval"] * float(np.nanmax(cell["sample_time"]))
                row.append(_number(values["largest"]))
                row.append(f"{_number(values['rise'])} +- {_number(doubt)}")
                row.append(_law(cell, quantity))
            row.append(_law(cell, "phase"))
            rows.append(row)
    header = ["scene", "integrator", "outcome"]
    for quantity in CONSTANTS:
        header += [f"largest {quantity} residual", f"trend of {quantity} over the run", f"exponent, law of {quantity}"]
    here = data.sel(scene=LONG)
    kept = [name for name in here["integrator"].values if np.isfinite(here["horizon_predicted"].sel(integrator=name))]
    horizons = [
        [str(name), *(f"{float(here[f'horizon_{part}'].sel(integrator=name)):.6g}" for part in HORIZON)]
        for name in kept
    ]
    walked = [name for name in KNOWN if np.isfinite(here["rounding_end"].sel(integrator=name))]
    walks = [[name, *(f"{float(here[part].sel(integrator=name)):.2g}" for part in ROUNDING_PARTS)] for name in walked]
    return [
        Table(
            "Relative residuals, linear trends with 95 % intervals, growth ~ t^exponent, its law and where it changes",
            [*header, "exponent, law of phase"],
            rows,
        ),
        Table("Rounding: drift of the modified energy of an ensemble", ["integrator", *ROUNDING_PARTS.values()], walks),
        Table(f"Nutations until {LOST:g} rad of phase are lost", ["integrator", *HORIZON.values()], horizons),
    ]


HORIZON = {"steps": "steps a nutation", "predicted": "foretold", "measured": "measured", "ratio": "ratio"}
ROUNDING_PARTS = {
    "rounding_exponent": "exponent",
    "rounding_exponent_interval": "+- (95 %)",
    "rounding_end": "drift at the end",
    "rounding_plain_exponent": "exponent, plain sums",
    "rounding_plain_end": "drift at the end, plain sums",
    "rounding_gain": "gain, the same starts",
    "rounding_p_phi": "largest change of p_phi",
    "rounding_p_psi": "largest change of p_psi",
}
ROUNDING = 3e-13  # relative: what a million steps of rounding explain
FAILED = "failed"
WORST = ("kept", "bounded", "random walk", "growing", "drift")  # each is worse than those before it


def kind(cell: xr.Dataset, quantity: str) -> str:
    """What became of a quantity (see `behaviour`), on the scene where it fared worst. `cell` covers all scenes."""
    if not (cell["outcome"] == "ok").all():
        return FAILED
    parts = (cell[f"{quantity}_{part}"].values for part in ("largest", "exponent", "exponent_interval"))
    return max((behaviour(*map(float, one), ROUNDING) for one in zip(*parts, strict=True)), key=WORST.index)


def _shares(data: xr.Dataset) -> dict[str, float]:
    """Integrators whose runs are shorter than the others', with the share of the horizon that they were given."""
    ends = data["sample_time"].max("sample")
    shares = (ends / ends.max("integrator")).min("scene")
    values = {str(name): float(shares.sel(integrator=name)) for name in data["integrator"].values}
    return {name: share for name, share in values.items() if share < 0.99}


def _shortened(data: xr.Dataset) -> str:
    shares = sorted(_shares(data).items(), key=lambda item: -item[1])
    listed = ", ".join(f"{name} {100.0 * share:.2g} %" for name, share in shares)
    return f"Some ran only a part of the horizon, for their cost, and are judged on it: {listed}." if listed else ""


def verdict(data: xr.Dataset) -> list[str]:
    """Who keeps what, and at what rate the others lose it."""
    sentences = []
    for quantity in CONSTANTS:
        groups: dict[str, list[tuple[float, str, float]]] = {}
        for name in data["integrator"].values:
            cell = data.sel(integrator=name)
            worst, rate = (float(cell[f"{quantity}_{part}"].max()) for part in ("largest", "exponent"))
            groups.setdefault(kind(cell, quantity), []).append((worst, str(name), rate))
        if kept := groups.get("kept"):
            sentences.append(f"{quantity} stays at rounding with {len(kept)} methods (at most {max(kept)[0]:.1e}).")
        if held := groups.get("bounded"):
            (least, best, _), (most, last, _) = min(held), max(held)
            span = f"from {least:.1e} ({best}) to {most:.1e} ({last})" if len(held) > 1 else f"{most:.1e} ({last})"
            sentences.append(f"{quantity} has a bounded error with {len(held)} methods, {span}.")
        for word, said in (("drift", "drifts"), ("growing", "grows by no single law"), ("random walk", "wanders")):
            if lost := groups.get(word):
                listed = ", ".join(f"{name} (to {worst:.1e}, as t^{rate:.2f})" for worst, name, rate in sorted(lost))
                sentences.append(f"{quantity} {said} with {listed}.")
        if failed := groups.get(FAILED):
            sentences.append(f"Runs of {', '.join(name for _, name, _ in failed)} ended early.")
    here = data.sel(scene=LONG)
    walkers = [name for name in KNOWN if np.isfinite(here["rounding_end"].sel(integrator=name))]
    sentences += [f"Rounding: {_walk(here.sel(integrator=name))}" for name in walkers]
    sentences.append(f"When {LOST:g} rad of phase are lost: {_horizons(here)}")
    return [*sentences, said] if (said := _shortened(data)) else sentences


STUDY = Study(
    name="drift",
    title="Drift",
    question="What happens to energy, momenta and phase over a million steps, and over 10^8?",
    how_to_read=(
        "A flat line is a bounded error, a line of slope one a steady drift, and a slope of one half the random walk "
        "of rounding. The discrete methods hold a larger but bounded energy error and exact momenta; a Runge-Kutta "
        "method begins with a smaller error and loses everything in time."
    ),
    cases=cases,
    full=full,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
)
