"""What became of every variant over a million steps: a sentence a constant, one on the phase, and their tables."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.report.sentences import counted, few
from symtop.runner.study import Table

from .tables import FAILED, worst_behaviour

SEEN_PHASE = 1e-11  # rad
ROUNDED_PHASE = 1e-9  # rad: symplectic methods of order 8 reach 4.6e-10 in a million steps, by rounding
FULL_LENGTH = 0.99  # of the longest run of a scene: a shorter run is named
PHASE_SLACK = 0.1  # of an exponent
STEADY, FASTER, UNCLEAR = "as t", "faster than t", "by no one power on all scenes"
MEANING = {  # behaviours, from the best to the worst
    "kept": "at rounding", "bounded": "bounded error", "random walk": "walks randomly",
    "growing": "grows by no single law", "drift": "drifts steadily", FAILED: "a run ended early",
}  # fmt: skip

ENERGY = {  # what it does, by its behaviour
    "kept": "is at rounding", "bounded": "has a bounded error", "random walk": "walks randomly",
    "growing": "grows by no single law", "drift": "drifts", FAILED: "is unknown, since a run ended early,",
}  # fmt: skip


class Fate(NamedTuple):
    """What became of one constant with one variant."""

    largest: float  # relative change, on any scene
    row: str
    exponent: float  # of time, on the scene where it is largest


class Phase(NamedTuple):
    """How the phase error of one variant grows."""

    largest: float  # rad, on any scene
    row: str
    powers: str  # of time, scene by scene

    @property
    def said(self) -> str:
        """All three in a list."""
        return f"{self.row} ({self.powers}, to {self.largest:.1g} rad)"


def fates(histories: xr.Dataset, constant: str) -> dict[str, list[Fate]]:
    """The variants by what became of a constant on the scene where it fared worst, a key of `MEANING`."""
    groups: dict[str, list[Fate]] = {word: [] for word in MEANING}
    asked = histories[["outcome", *(f"{constant}_{part}" for part in ("largest", "exponent", "exponent_interval"))]]
    for k, row in enumerate(map(str, histories["variant"].values)):
        cell = asked.isel(variant=k)
        largest, rate = (float(cell[f"{constant}_{part}"].max()) for part in ("largest", "exponent"))
        groups[worst_behaviour(cell, constant)].append(Fate(largest, row, rate))
    return {word: sorted(group) for word, group in groups.items() if group}


def constant_sentence(histories: xr.Dataset, constant: str) -> str:
    """How many variants keep a constant, bound its error, or lose it, with the worst of each."""
    groups = fates(histories, constant)
    kept, held, failed = (groups.get(word, []) for word in ("kept", "bounded", FAILED))
    lost = sorted(one for word in ("random walk", "growing", "drift") for one in groups.get(word, []))
    parts = [f"is no more than rounding with {len(kept)} (up to {kept[-1].largest:.1e})"] if kept else []
    for group, does in ((held, "stays bounded over the run"), (lost, "grows in time")):
        if group:
            parts.append(f"{does} with {len(group)} (up to {group[-1].largest:.1e}, {group[-1].row})")
    parts += [f"is unknown with {len(failed)} whose run ended early"] if failed else []
    count = sum(map(len, groups.values()))
    return f"Of {counted(count)}, the relative change of {_the(constant)} {_said(parts)}."


def _said(parts: Sequence[str]) -> str:
    """Parts of a sentence that have commas of their own."""
    return f"{', '.join(parts[:-1])}, and {parts[-1]}" if len(parts) > 2 else " and ".join(parts)


def _the(constant: str) -> str:
    return f"the {constant}" if constant == "energy" else constant


def phases(histories: xr.Dataset) -> dict[str, list[Phase]]:
    """The variants by how their phase error grows: as t, faster, or by no one power on all scenes; the largest first.

    It grows as t if the interval of the exponent, or `PHASE_SLACK`, reaches 1 on every scene, and faster if it lies
    above 1 by more on every scene. Phases below `SEEN_PHASE` are left out.
    """
    groups: dict[str, list[Phase]] = {STEADY: [], FASTER: [], UNCLEAR: []}
    for variant in map(str, histories["variant"].values):
        cell = histories.sel(variant=variant)
        seen = cell["phase_largest"].values > SEEN_PHASE
        sizes, slopes, doubts = (
            cell[f"phase_{part}"].values[seen] for part in ("largest", "exponent", "exponent_interval")
        )
        if not slopes.size or not np.isfinite(slopes).all():
            continue
        doubt = np.maximum(doubts, PHASE_SLACK)
        steady, faster = bool(np.all(np.abs(slopes - 1.0) <= doubt)), bool(np.all(slopes - doubt > 1.0))
        powers = " and ".join(dict.fromkeys(f"t^{slope:.2f}" for slope in slopes))
        word = STEADY if steady else FASTER if faster else UNCLEAR
        groups[word].append(Phase(float(sizes.max()), variant, powers))
    return {word: sorted(group, reverse=True) for word, group in groups.items() if group}


def phase_sentence(histories: xr.Dataset) -> str:
    """By what power of time the phase error grows, from the measured exponents; empty if none was seen."""
    groups = phases(histories)
    steady, faster, unclear = (groups.get(word, []) for word in (STEADY, FASTER, UNCLEAR))
    parts = [f"The phase error grows as t with {_rows(steady)}."] if steady else []
    if faster:
        subject = "It" if steady else "The phase error"
        parts.append(f"{subject} grows faster with {_rows(faster)}, and is largest with {faster[0].said}.")
    if unclear:
        parts.append(f"With {_rows(unclear)} no one power fits all scenes.")
    if parts and (unseen := _unseen(histories)):
        parts.append(f"With {counted(unseen)} none is seen.")
    if parts and (rest := histories.sizes["variant"] - sum(map(len, groups.values())) - unseen):
        parts.append(f"With {counted(rest)} no power was fitted.")
    return " ".join(parts)


def _unseen(histories: xr.Dataset) -> int:
    """How many variants have no phase error above `SEEN_PHASE` on any scene."""
    return int((~(histories["phase_largest"] > SEEN_PHASE).any("scene")).sum())


def faster_sentence(histories: xr.Dataset) -> str:
    """What the energy does where the phase error grows faster than t; empty if it does nowhere."""
    fast = phases(histories).get(FASTER, [])
    if not fast:
        return ""
    fate = {one.row: word for word, group in fates(histories, "energy").items() for one in group}
    drifting = sum(fate[one.row] == "drift" for one in fast)
    said = [f"Of {counted(len(fast))} whose phase error grows faster than t, the energy drifts with {drifting}"]
    shares = run_shares(histories)
    for word in reversed(MEANING):
        rest = [one for one in fast if fate[one.row] == word != "drift"]
        if not rest:
            continue
        names = [
            f"{one.row}{f' over {100.0 * shares[one.row]:.2g}% of the horizon' * (shares[one.row] < FULL_LENGTH)}"
            for one in rest
        ]
        small = all(one.largest < ROUNDED_PHASE for one in rest)
        note = f": phase errors below {ROUNDED_PHASE:g} rad, which may be rounding" if small else ""
        said.append(f"it {ENERGY[word]} with {len(rest)} ({few(names)}{note})")
    return f"{'; '.join(said)}."


def run_shares(histories: xr.Dataset) -> dict[str, float]:
    """The length of every variant's run over that of the longest, on the scene where it is least."""
    ends = histories["sample_time"].max("sample")
    shares = (ends / ends.max("variant")).min("scene")
    return dict(zip(map(str, histories["variant"].values), map(float, shares.values), strict=True))


def _rows(group: Sequence[Phase]) -> str:
    """One or two variants by name, more by their number."""
    return few([one.row for one in group], most=2)


def tables(histories: xr.Dataset) -> list[Table]:
    """How many variants fare how, and every variant: what became of its constants and of its phase."""
    counts = [
        [constant, MEANING[word], str(len(group)), f"{group[0].largest:.1e}", group[0].row, f"{group[-1].largest:.1e}",
         group[-1].row]
        for constant in CONSTANTS for word, group in fates(histories, constant).items()
    ]  # fmt: skip
    header = ["constant", "what became of it", "variants", "least change", "with", "largest change", "with"]
    title = "What became of energy and momenta: largest relative change, on the scene where a variant fares worst"
    shown = Table(title, header, counts)
    grown = {one.row: (one, word) for word, group in phases(histories).items() for one in group}
    cells: dict[str, list[str]] = {row: [row] for row in map(str, histories["variant"].values)}
    for constant in CONSTANTS:
        for word, group in fates(histories, constant).items():
            for one in group:
                power = f", t^{one.exponent:.2f}" if np.isfinite(one.exponent) else ""
                cells[one.row] += [f"{one.largest:.1e}", f"{MEANING[word]}{power}"]
    for row, cell in cells.items():
        phase, word = grown.get(row, (None, "not seen"))
        cell.extend([f"{phase.largest:.1g}", phase.powers, word] if phase else ["", "", word])
    columns = [head for one in CONSTANTS for head in (f"largest change of {one}", f"behaviour of {one}")]
    every = Table("Every variant, over all scenes", ["variant", *columns, "phase error (rad)", "powers", "it grows"],
                  list(cells.values()))  # fmt: skip
    return [shown, every]
