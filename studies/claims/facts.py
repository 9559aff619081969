"""Facts and tables of the study: every finding in a row, how many there are of each verdict, and the long runs."""

from collections import Counter
from typing import Any

import pandas as pd
import xarray as xr

from symtop.judging.battery import CLAIMS, SCENE
from symtop.judging.findings import VERDICTS, claim_name
from symtop.methods.framework.registry import integrators

from .planted import LIES

FREE = "check-case-2"  # the scene of the claims on a body without symmetry
EVERY = [*CLAIMS, "momentum"]  # L in space, of a free body
FIRST = ("refuted", "undecided", "confirmed", "measured", "inapplicable")  # of the verdicts


def parts(data: xr.Dataset) -> tuple[xr.Dataset, pd.DataFrame]:
    """The dataset without the integrators with planted false claims, and the findings on those."""
    false = data["variant"].isin(list(LIES))
    return data.isel(variant=~false), ledger(data.isel(variant=false))


def caught(entries: pd.DataFrame) -> pd.Series:
    """For each integrator with a planted false claim, by name: is that claim refuted?"""
    lies = entries[entries["claim"] == entries["integrator"].map(LIES)]
    return lies.set_index("integrator")["verdict"] == "refuted"


def ledger(data: xr.Dataset) -> pd.DataFrame:
    """A row for each finding, the refuted first; an integrator that is no longer registered has the family "other"."""
    names = ["scene", "variant", "claim", "declared", "measured", "verdict", "value", "resolution", "why"]
    frame = data[names[3:]].to_dataframe().reset_index()[names]
    frame = frame[frame["verdict"].isin(VERDICTS)].rename(columns={"variant": "integrator"})
    families = {name: method.family for name, method in integrators().items()}
    frame.insert(2, "family", frame["integrator"].map(families).fillna("other"))
    ranks = {"verdict": FIRST.index, "claim": EVERY.index}
    return frame.sort_values(list(ranks), key=lambda column: column.map(ranks[str(column.name)]), kind="stable")


def by_kind(entries: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The findings on tops, and those on the free body."""
    return entries[entries["scene"] != FREE], entries[entries["scene"] == FREE]


def facts(data: xr.Dataset) -> dict[str, Any]:
    """How many claims have each verdict, how many planted false claims are refuted, and the steps of the long runs."""
    data, false = parts(data)
    refuted = caught(false)
    table = ledger(data)
    unsaid = (table["declared"] == "") & (table["verdict"] == "undecided")  # nothing is declared there
    entries, bodies = by_kind(table[~unsaid])
    count, on_body = Counter(entries["verdict"]), Counter(bodies["verdict"])
    steps = data["steps_run"].sel(scene=SCENE).to_series()
    steps = steps[steps > 0].astype(int)
    undecided = Counter(entries["claim"][entries["verdict"] == "undecided"].map(claim_name))
    ((open_claim, open_most),) = undecided.most_common(1) or [(None, None)]
    reasons = entries["why"][(entries["verdict"] == "undecided") & (entries["claim"].map(claim_name) == open_claim)]
    ((open_why, _),) = Counter(why.partition(", in the ")[0] for why in reasons).most_common(1) or [(None, None)]
    ((usual, usual_runs),) = Counter(steps).most_common(1) or [(None, None)]
    return {
        "integrators": entries["integrator"].nunique() or None,
        "scene": SCENE,
        "declared": count["confirmed"] + count["refuted"] or None,  # and judged
        "held": count["confirmed"],
        **{word: count[word] for word in ("refuted", "undecided")},
        "planted": len(refuted) or None,  # integrators that make a false claim
        "caught": int(refuted.sum()),
        "open_claim": open_claim,  # that most of the undecided findings are on
        "open_most": open_most,
        "open_why": open_why,  # the reason that most of these have
        "unsaid": len(by_kind(table[unsaid])[0]),  # undecided findings on what is not declared
        "runs": len(steps) or None,
        "usual": usual,  # steps of a long run
        "usual_runs": usual_runs,
        "free": FREE,
        "free_methods": bodies["integrator"].nunique() or None,
        **{f"free_{word}": on_body[word] for word in ("confirmed", "refuted", "undecided")},
    }


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Every finding on tops, the findings on the planted false claims, and those on the free body."""
    data, false = parts(data)
    lies = false[false["claim"] == false["integrator"].map(LIES)]
    entries, bodies = by_kind(ledger(data))
    frames = {"ledger": entries, "planted": lies.drop(columns=["scene", "family"]), "body": bodies}
    return {name: part.assign(claim=part["claim"].map(claim_name)) for name, part in frames.items() if len(part)}
