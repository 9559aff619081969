"""Facts and tables of the study of drift."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.measure.conservation import CONSTANTS, RUN_ROUNDING
from symtop.run.long_run import PER_NUTATION

from .measures import (
    BEHAVIOURS,
    FAILED,
    HELD,
    HISTORIES,
    HORIZONS,
    ROUNDINGS,
    WINDOWS,
    as_time,
    faster,
    fates,
    losses,
    phases_by_energy,
    shares,
    shifts,
)
from .phase_loss import LOST

MEANING = {
    "kept": "at rounding", "bounded": "bounded error", "random walk": "walks randomly",
    "growing": "grows by no single law", "drift": "drifts steadily", FAILED: "a run ended early",
}  # fmt: skip
CLOSE = 0.1  # a prediction that is further off, relative, counts as missed
WHOLE = 0.99  # share of the longest run of a scene, below which a run counts as shortened
NAMES = {  # of the facts of each group
    HISTORIES: "nutations steps tolerance own variants holding ended shortened shortest energy_lost "
    "energy_drifts energy_lost_most energy_lost_worst momentum_lost bounded_runs bounded_as_t lost_runs lost_faster",
    WINDOWS: "long_steps long_scene moved scattered long_momenta",
    ROUNDINGS: "members walk_least walk_most walk_interval gain_least gain_most",
    HORIZONS: "lost_short lost_later lost_hits lost_hit_most lost_count",
}


def facts(data: xr.DataTree) -> dict[str, Any]:
    """The settings of the runs, and how constants and phase changed; changes are relative."""
    values: dict[str, Any] = dict.fromkeys(" ".join(NAMES.values()).split()) | {
        "rounding": RUN_ROUNDING,  # the largest change that a million steps of rounding explain
        "per_nutation": PER_NUTATION,  # steps of the long runs
        "lost_phase": LOST,  # rad
    }
    measures = {HISTORIES: of_histories, WINDOWS: of_windows, ROUNDINGS: of_walks, HORIZONS: of_losses}
    for group, of_group in measures.items():
        if group in data:
            values |= of_group(data[group].to_dataset())
    return values


def of_histories(histories: xr.Dataset) -> dict[str, Any]:
    """A million steps of every variant."""
    fate, phases, length = fates(histories), phases_by_energy(histories), shares(histories)
    default = histories["own_tolerance"].max("scene").values > 0.0
    tolerances = histories["tolerance"].max("scene").values[~default]
    kept = fate[list(CONSTANTS)].isin(HELD)
    lost = fate["energy_largest"][fate["energy"].isin(BEHAVIOURS[2:])]
    return {
        "nutations": float(histories["nutations"].max()),
        "steps": float(histories["steps_a_nutation"].max()),
        "tolerance": float(np.nanmax(tolerances)) if np.isfinite(tolerances).any() else None,
        "own": int(default.sum()),  # variants that ran at their own tolerance, the rounding of the arithmetic
        "variants": len(fate),
        "holding": int(kept.all(axis=1).sum()),
        "shortened": int((length < WHOLE).sum()),
        "shortest": float(length.min()),  # share of the run length
        "energy_lost": len(lost),
        "ended": int((fate["energy"] == FAILED).sum()),
        "momentum_lost": int((kept["energy"] & ~kept.all(axis=1)).sum()),  # variants that keep the energy
        "energy_drifts": int((fate["energy"] == "drift").sum()),
        "energy_lost_most": float(lost.max()) if len(lost) else None,
        "energy_lost_worst": str(lost.idxmax()) if len(lost) else None,
        "bounded_runs": phases["bounded"].size or None, "bounded_as_t": int(as_time(phases["bounded"]).sum()),
        "lost_runs": phases["lost"].size or None, "lost_faster": int(faster(phases["lost"]).sum()),
    }  # fmt: skip


def of_windows(windows: xr.Dataset) -> dict[str, Any]:
    """The long runs: how far mean energies move, over the width of the oscillation of the energy."""
    moves = np.abs(shifts(windows))
    parts = [np.abs(windows[f"{name}_{part}"]).max() for name in ("p_phi", "p_psi") for part in ("least", "largest")]
    return {
        "long_steps": float(windows["steps"].max()),
        "long_scene": str(windows["scene"].values[0]),
        "moved": float(moves.isel(window=-1).max()),
        "scattered": float(moves.max()),
        "long_momenta": max(map(float, parts)),
    }


def of_walks(ensembles: xr.Dataset) -> dict[str, Any]:
    """Drift by rounding: powers of the number of steps with compensated sums, and what those gain over plain ones."""
    powers, gains = (ensembles[name].isel(scene=0).values for name in ("exponent", "gain"))
    return {
        "members": ensembles.sizes["member"],
        "walk_least": float(powers.min()), "walk_most": float(powers.max()),
        "walk_interval": float(ensembles["exponent_interval"].isel(scene=0).max()),
        "gain_least": float(gains.min()), "gain_most": float(gains.max()),
    }  # fmt: skip


def of_losses(horizons: xr.Dataset) -> dict[str, Any]:
    """How well a short run predicts when the phase is lost."""
    lost, short = loss_table(horizons), float(horizons["short"].max())
    misses = np.abs(lost["predicted / measured"] - 1.0)
    return {
        "lost_short": short,  # nutations
        "lost_later": float(lost["measured (nutations)"].median() / short),  # times as late as the short run ends
        "lost_hits": int((misses <= CLOSE).sum()),
        "lost_hit_most": float(misses[misses <= CLOSE].max()),
        "lost_count": len(lost),
    }


def tables(data: xr.DataTree) -> dict[str, pd.DataFrame]:
    """How many variants keep or lose each constant; every variant; losses of phase."""
    groups = {name: group.to_dataset() for name, group in data.children.items()}
    frames: dict[str, pd.DataFrame] = {}
    if HISTORIES in groups:
        frames |= {"behaviours": behaviour_table(groups[HISTORIES]), "variants": variant_table(groups[HISTORIES])}
    if HORIZONS in groups:
        frames["losses"] = loss_table(groups[HORIZONS])
    return frames


def behaviour_table(histories: xr.Dataset) -> pd.DataFrame:
    """For each constant and behaviour, how many variants show it, and the least and the largest change among them."""
    fate, rows = fates(histories), []
    for constant in CONSTANTS:
        for word in (*BEHAVIOURS, FAILED):
            if len(sizes := fate[f"{constant}_largest"][fate[constant] == word].sort_values(kind="stable")):
                ends = (part for place in (0, -1) for part in (sizes.iloc[place], sizes.index[place]))
                rows.append([constant, MEANING[word], len(sizes), *ends])
    header = ["constant", "what became of it", "variants", "least change", "with", "largest change", "by"]
    return pd.DataFrame(rows, columns=header)


def variant_table(histories: xr.Dataset) -> pd.DataFrame:
    """Every variant over all scenes, sorted by the change of the energy, the largest first."""
    names = {f"{name}_largest": f"change of {name}" for name in CONSTANTS}
    table = fates(histories).rename(columns=names).replace(dict.fromkeys(CONSTANTS, MEANING))
    table["phase error (rad)"] = histories["phase_largest"].max("scene").values
    powers = histories["phase_exponent"]
    table["grows as t to the, least"], table["most"] = powers.min("scene").values, powers.max("scene").values
    return table.sort_values("change of energy", ascending=False, kind="stable").reset_index(names="variant")


def loss_table(horizons: xr.Dataset) -> pd.DataFrame:
    """When the phase error reaches `LOST`, predicted and measured; the worst predictions first."""
    columns = {"steps": "steps a nutation", "evaluations": "force evaluations a nutation",
               "predicted": "predicted (nutations)", "measured": "measured (nutations)",
               "ratio": "predicted / measured"}  # fmt: skip
    rows = [[name, *(float(cell[column]) for column in columns)] for name, cell in losses(horizons).items()]
    table = pd.DataFrame(rows, columns=["variant", *columns.values()])
    return table.loc[(table["predicted / measured"] - 1.0).abs().sort_values(ascending=False, kind="stable").index]
