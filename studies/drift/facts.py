"""Facts and tables of the study of drift."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.measure.conservation import CONSTANTS, RUN_ROUNDING
from symtop.methods.framework.registry import split_name
from symtop.model.charts import CHARTS
from symtop.run.long_run import PER_NUTATION, SAMPLES

from .measures import (
    APART,
    BEHAVIOURS,
    FAILED,
    HELD,
    HISTORIES,
    HORIZONS,
    ROUNDINGS,
    WINDOWS,
    apart,
    as_time,
    faster,
    fates,
    losses,
    pairs,
    phases_by_energy,
    shares,
    shifts,
    without_repeats,
)
from .phase_loss import LOST

MEANING = {
    "kept": "at rounding", "bounded": "bounded error", "random walk": "walks randomly",
    "growing": "grows by no single law", "drift": "drifts steadily", FAILED: "a run ended early",
}  # fmt: skip
CLOSE = 0.1  # a prediction that is further off, relative, counts as missed
WHOLE = 0.99  # of the longest run of a scene: a shorter run counts as shortened
SHOWN = (  # in the figure of the residuals
    "midpoint[angles]", "stormer-verlet[angles]", "strang[axis]", "gauss-4[axis]", "rk4[angles]", "rk4[axis]",
    "rk45[angles]", "taylor[axis]",
)  # fmt: skip
NAMES = {  # of the facts of each group
    HISTORIES: "scenes nutations steps tolerance own variants holding ended shown shown_holding shortened shortest "
    "charts apart chart_worse chart_better chart_change chart_other bounded_runs bounded_as_t lost_runs lost_faster",
    WINDOWS: "long_steps long_scene long_count moved scattered modified_moved long_momenta",
    ROUNDINGS: "walk_steps members plain_members walk_least walk_most walks walk_count gain_least gain_most",
    HORIZONS: "lost_short lost_later lost_hits lost_hit_most lost_count lost_unpredicted",
}
OF_CONSTANT = [f"{word}{what}" for word in ("kept", "bounded", "lost") for what in ("", "_most", "_worst")]


def facts(data: xr.DataTree) -> dict[str, Any]:
    """What was held fixed, and what became of constants and phase; changes are relative."""
    names = [*" ".join(NAMES.values()).split(), *(f"{one}_{what}" for one in CONSTANTS for what in OF_CONSTANT)]
    answers: dict[str, Any] = dict.fromkeys(names) | {
        "rounding": RUN_ROUNDING,  # the largest change that a million steps of rounding explain
        "apart_times": APART,
        "per_nutation": PER_NUTATION,  # steps of the long runs
        "samples": SAMPLES,  # of a window of them
        "lost_phase": LOST,  # rad
        "close": CLOSE,
    }
    measures = {HISTORIES: of_histories, WINDOWS: of_windows, ROUNDINGS: of_walks, HORIZONS: of_losses}
    for group, of_group in measures.items():
        if group in data:
            answers |= of_group(data[group].to_dataset())
    return answers


def of_histories(every: xr.Dataset) -> dict[str, Any]:
    """A million steps of every variant."""
    histories = without_repeats(every)
    fate, phases = fates(histories), phases_by_energy(histories)
    holding = fate[list(CONSTANTS)].isin(HELD)
    shown = [name for name in SHOWN if name in fate.index]
    own = histories["own_tolerance"].max("scene").values > 0.0
    given = histories["tolerance"].max("scene").values[~own]
    length = shares(histories)
    differing, known = apart(every), {split_name(one.worse)[0] for one in pairs(every)}
    worst = max(differing, key=lambda one: one.change if one.constant != "energy" else 0.0, default=None)
    return {
        "scenes": " and ".join(map(str, histories["scene"].values)),
        "nutations": float(histories["nutations"].max()),
        "steps": float(histories["steps_a_nutation"].max()),
        "tolerance": float(np.nanmax(given)) if np.isfinite(given).any() else None,
        "own": int(own.sum()),  # variants that ran at their own tolerance, the rounding of the arithmetic
        "variants": len(fate),
        "holding": int(holding.all(axis=1).sum()),  # all three constants
        "ended": int((fate["energy"] == FAILED).sum()),  # early
        "shown": len(shown),
        "shown_holding": int(holding["energy"][shown].sum()),
        "shortened": int((length < WHOLE).sum()),
        "shortest": float(length.min()),  # share of the run length
        "charts": len(known) or None,  # methods with more than one
        "apart": len({split_name(one.worse)[0] for one in differing}) if known else None,
        "chart_worse": worst and worst.worse, "chart_better": worst and worst.better,  # of a momentum
        "chart_change": worst and worst.change, "chart_other": worst and worst.other,
        "bounded_runs": phases["bounded"].size, "bounded_as_t": int(as_time(phases["bounded"]).sum()),
        "lost_runs": phases["lost"].size, "lost_faster": int(faster(phases["lost"]).sum()),
        **{f"{one}_{name}": value for one in CONSTANTS for name, value in of_constant(fate, one).items()},
    }  # fmt: skip


def of_constant(fate: pd.DataFrame, constant: str) -> dict[str, Any]:
    """How many variants keep a constant, bound its error or lose it, with the largest change of each."""
    answers: dict[str, Any] = {}
    for word, chosen in (("kept", BEHAVIOURS[:1]), ("bounded", BEHAVIOURS[1:2]), ("lost", BEHAVIOURS[2:])):
        largest = fate[f"{constant}_largest"][fate[constant].isin(chosen)]
        answers |= {word: len(largest), f"{word}_most": float(largest.max()) if len(largest) else None}
        answers[f"{word}_worst"] = str(largest.idxmax()) if len(largest) else None
    return answers


def of_windows(windows: xr.Dataset) -> dict[str, Any]:
    """The long runs: how far mean energies move, over the width of the oscillation of the energy."""
    moves, full = np.abs(shifts(windows)), windows.dropna("window", how="all", subset=["energy_mean"])
    modified = full["modified_energy_mean"]
    parts = [np.abs(windows[f"{name}_{part}"]).max() for name in ("p_phi", "p_psi") for part in ("least", "largest")]
    return {
        "long_steps": float(windows["steps"].max()),
        "long_scene": str(windows["scene"].values[0]),
        "long_count": windows.sizes["variant"],
        "moved": float(moves.isel(window=-1).max()),
        "scattered": float(moves.max()),
        "modified_moved": float(np.abs(modified.isel(window=-1) - modified.isel(window=0)).max()),  # of E0 - min V
        "long_momenta": max(map(float, parts)),
    }


def of_walks(ensembles: xr.Dataset) -> dict[str, Any]:
    """Drift by rounding: powers of the number of steps with compensated sums, and what those gain over plain ones."""
    cells = ensembles.isel(scene=0)
    powers, gains = cells["exponent"].values, cells["gain"].values
    return {
        "walk_steps": float(cells["elapsed"].max()),
        "members": cells.sizes["member"], "plain_members": cells.sizes["plain_member"],
        "walk_least": float(powers.min()), "walk_most": float(powers.max()),
        "walks": int((np.abs(powers - 0.5) <= cells["exponent_interval"].values).sum()),
        "walk_count": powers.size,
        "gain_least": float(gains.min()), "gain_most": float(gains.max()),
    }  # fmt: skip


def of_losses(horizons: xr.Dataset) -> dict[str, Any]:
    """How well a short run predicts when the phase is lost."""
    lost = loss_table(horizons)
    off = np.abs(lost["predicted / measured"] - 1.0)
    later = lost["measured (nutations)"] / float(horizons["short"].max())
    return {
        "lost_short": float(horizons["short"].max()),  # nutations
        "lost_later": float(later.median()),  # times as late as the short run ends
        "lost_hits": int((off <= CLOSE).sum()),
        "lost_hit_most": float(off[off <= CLOSE].max()),
        "lost_count": len(lost),
        "lost_unpredicted": horizons.sizes["variant"] - len(lost),
    }


def tables(data: xr.DataTree) -> dict[str, pd.DataFrame]:
    """What became of the constants; every variant; where the chart matters; losses of phase."""
    groups = {name: group.to_dataset() for name, group in data.children.items()}
    made: dict[str, pd.DataFrame] = {}
    if HISTORIES in groups:
        histories = without_repeats(groups[HISTORIES])
        made |= {"behaviours": behaviour_table(histories), "variants": variant_table(histories)}
        made["charts"] = chart_table(groups[HISTORIES])
    if HORIZONS in groups:
        made["losses"] = loss_table(groups[HORIZONS])
    return made


def behaviour_table(histories: xr.Dataset) -> pd.DataFrame:
    """How many variants fare how with each constant, and the least and the largest change among them."""
    fate, rows = fates(histories), []
    for constant in CONSTANTS:
        for word in (*BEHAVIOURS, FAILED):
            if len(sizes := fate[f"{constant}_largest"][fate[constant] == word].sort_values(kind="stable")):
                ends = (part for place in (0, -1) for part in (sizes.iloc[place], sizes.index[place]))
                rows.append([constant, MEANING[word], len(sizes), *ends])
    header = ["constant", "what became of it", "variants", "least change", "with", "largest change", "by"]
    return pd.DataFrame(rows, columns=header)


def variant_table(histories: xr.Dataset) -> pd.DataFrame:
    """Every variant over all scenes, that with the largest change of the energy first."""
    names = {f"{one}_largest": f"change of {one}" for one in CONSTANTS}
    table = fates(histories).rename(columns=names).replace(dict.fromkeys(CONSTANTS, MEANING))
    table["phase error (rad)"] = histories["phase_largest"].max("scene").values
    powers = histories["phase_exponent"]
    table["grows as t to the, least"], table["most"] = powers.min("scene").values, powers.max("scene").values
    return table.sort_values("change of energy", ascending=False, kind="stable").reset_index(names="variant")


def chart_table(histories: xr.Dataset) -> pd.DataFrame:
    """The largest change of a constant in every chart of the methods for which the chart matters."""
    losing = dict.fromkeys((one.constant, split_name(one.worse)[0]) for one in apart(histories))
    largest = {one: histories[f"{one}_largest"].max("scene").to_series() for one in CONSTANTS}
    rows = [[*place, *(largest[place[0]].get(f"{place[1]}[{chart}]") for chart in CHARTS)] for place in losing]
    return pd.DataFrame(rows, columns=["constant", "method", *(f"[{chart}]" for chart in CHARTS)])


def loss_table(horizons: xr.Dataset) -> pd.DataFrame:
    """When the phase error reaches `LOST`, predicted and measured; the worst predictions first."""
    columns = {"steps": "steps a nutation", "evaluations": "force evaluations a nutation",
               "predicted": "predicted (nutations)", "measured": "measured (nutations)",
               "ratio": "predicted / measured"}  # fmt: skip
    rows = [[name, *(float(cell[column]) for column in columns)] for name, cell in losses(horizons).items()]
    table = pd.DataFrame(rows, columns=["variant", *columns.values()])
    return table.loc[(table["predicted / measured"] - 1.0).abs().sort_values(ascending=False, kind="stable").index]
