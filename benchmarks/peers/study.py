"""The peers as a study of the report: its question, its figure, its words, and where and when it was measured."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from benchmarks import pages
from benchmarks.measured import record
from benchmarks.peers import distributions, summary, together
from benchmarks.peers.measure import HEYOKA, OURS, PERIODS
from benchmarks.peers.summary import ENGINES, JUDGED, NAMES
from symtop.report import style
from symtop.report.formats import number
from symtop.runner import run as runner
from symtop.runner.study import Picture, Study

SOLVE_IVP = "scipy["  # how the groups of SciPy's solve_ivp begin: a chart and a language each
SPOKEN, OTHER = style.VERMILLION, "#888888"  # variants that the title is about, and the others


def pictures(data: xr.Dataset) -> list[Picture]:
    """The time of each library over that of symtop's on f(t, y) alone, in both calls; open, over its fastest of all."""
    known = summary.groups(data)
    ours = known.get(OURS, [])
    spans = {name: _spans(data, known[name]) for name in known if name not in (OURS, *ENGINES)}
    names = sorted((name for name in spans if all(spans[name])), key=lambda name: max(spans[name][0]))
    figure, axes = style.panels(1, len(NAMES), height=0.23 * len(names) + 1.1, sharey=True)
    for k, (axis, (call, words)) in enumerate(zip(axes[0], NAMES.items(), strict=True)):
        farthest, nearest = max((max(spans[name][k]) for name in names), default=1.0), 1.0
        for place, name in enumerate(names):
            ratios, color = spans[name][k], SPOKEN if name.startswith(SOLVE_IVP) else OTHER
            over_all = summary.ratios(data, call, ours, known[name])
            for values, height, face in ((ratios, place - 0.12, color), (over_all, place + 0.18, "white")):
                axis.plot(values, [height] * len(values), "o-", color=color, mfc=face, ms=4.0, lw=1.2)
            nearest, farthest = min(nearest, *ratios, *over_all), max(farthest, *over_all)
            axis.annotate(
                summary.range_of((min(ratios), max(ratios))), (1.02, place), xycoords=("axes fraction", "data"),
                va="center", fontsize=style.LEAST_TEXT, color=style.ink(color), annotation_clip=False,
            )  # fmt: skip
        axis.axvline(1.0, color=style.BLUE, lw=1.6)
        axis.set(xscale="log", xlim=(0.8 * nearest, 1.5 * farthest), ylim=(len(names) - 0.4, -0.6), title=words)
        axis.set_xlabel("times as long as symtop's fastest")
        axis.text(1.0, -0.65, " symtop", color=style.BLUE, fontsize=style.LEAST_TEXT, va="bottom", ha="center")
        axis.title.set_position((0.5, 1.06))
        axis.grid(visible=False, axis="y")
        axis.tick_params(axis="y", length=0)
    axes[0, 0].set_yticks(range(len(names)), [_label(name) for name in names], fontsize=style.LEAST_TEXT)
    for name, text in zip(names, axes[0, 0].get_yticklabels(), strict=True):
        text.set_color(SPOKEN if name.startswith(SOLVE_IVP) else "black")
    style.few_ticks(*axes.flat, most=5)
    scenes = " and ".join(data["scene"].values.astype(str))
    errors = " and ".join(number(target) for target in JUDGED)
    figure.supxlabel(
        f"A dot: the library's fastest run with an error of at most {errors} rad over {PERIODS:g} nutations of "
        f"{scenes},\nover symtop's fastest method on f(t, y) alone (full, and the numbers), or its fastest of all, "
        f"{', '.join(summary.fastest(data, ours))} (open).\nPublic call: what a user types. Inner loop: without set-up "
        "and samples.",
        fontsize=7.5, ha="left", x=0.01,
    )  # fmt: skip
    return [Picture("fronts", figure)]


def caption(data: xr.Dataset) -> tuple[str, str]:
    """Caption of the figure, and its text for those who cannot see it."""
    known, facts = summary.groups(data), summary.facts(data)
    gains, of_all = (_gains(data, known, rows) for rows in (summary.general(data), known.get(OURS, [])))
    clause = ", which is made of this top's equations and serves no other body" if facts["of_this_top"] else ""
    engines = ", ".join(
        f"{name} ({' and '.join(map(_range, spans))})"
        for name in ENGINES
        if name in known and all(spans := _spans(data, known[name]))
    )
    words = (
        f"SciPy's solve_ivp takes {gains[0]} as long as symtop's fastest on f(t, y) alone at the left, {gains[1]} at "
        f"the right; over {facts['fastest']}{clause} (open), {' and '.join(of_all)}. "
    ) if gains else ""  # fmt: skip
    words += (
        "Left of the blue line the library's fastest batch is faster than symtop's. After a comma stands the language "
        "of the right-hand side. All step (e, L), but arkode-sprk and the variants [angles] Euler's angles. symtop "
        "with heyoka is taylor, heyoka's stepper called by symtop. "
        + (f"Not drawn, since they model bodies and take no equations: {engines}. " if engines else "")
        + f"Measured was symtop {facts['version']}."
    )
    return words, "Dot plots of the time of each library over that of symtop, a panel for each call, a line a library."


def _range(ratios: Sequence[float]) -> str:
    return f"{summary.range_of((min(ratios), max(ratios)))} times"


def _spans(data: xr.Dataset, rows: Sequence[str]) -> list[list[float]]:
    """The ratios of a group to ours on f(t, y) alone in each call, of all scenes and judged accuracies."""
    return [summary.ratios(data, call, summary.general(data), rows) for call in NAMES]


def _label(name: str) -> str:
    """A group as the figure names it."""
    first, mark, language = name.partition(", ")
    if first.startswith("scipy"):
        first = "SciPy " + first.replace("scipy-", "").replace(SOLVE_IVP, "solve_ivp[")
    return f"{first}{mark}{language}"


def _gains(data: xr.Dataset, known: dict[str, list[str]], mine: Sequence[str]) -> list[str]:
    """How many times as long as `mine` SciPy's solve_ivp takes in both calls, whatever it was given; or nothing."""
    scipys = [name for name in known if name.startswith(SOLVE_IVP)]
    spans = [[summary.ratios(data, call, mine, known[name]) for call in NAMES] for name in scipys]
    calls = [[ratio for span in spans for ratio in span[k]] for k in range(len(NAMES))]
    return [_range(ratios) for ratios in calls] if all(calls) else []


def measured(data: xr.Dataset) -> dict[str, Any]:
    """When, where, with which versions and by which command."""
    pairs = zip(data["package"].values.astype(str), data["version"].values.astype(str), strict=True)
    wheels = distributions()
    versions = {wheels.get(name, name): version for name, version in pairs if name not in (OURS, HEYOKA)}
    return record(data.attrs, "make peers", versions)


STUDY = Study(
    name="peers",
    title="Beside other libraries",
    question="What would I gain or lose by using another library for this, as its user and as its author?",
    cases=lambda _: [],
    measure=lambda _: xr.Dataset(),
    pictures=pictures,
    facts=summary.facts,
    timed=True,
)


def findings(data: xr.Dataset, many: list[together.Row], results: Path, missing: list[str]) -> dict[str, Any]:
    """Draw, and say what was measured, with the runs of many tops at once."""
    result = runner.findings_of(
        STUDY, data, results, style.publish, failures=missing, cases=data["seconds"].count().item()
    )
    tables = [*summary.tables(data), *([together.table(many)] if many else [])]
    page = pages.findings(
        STUDY.name, STUDY.title, STUDY.question, [*summary.verdict(data), *together.verdict(many)],
        summary.HOW_TO_READ, tables, answer=summary.answer(data), further=summary.pairs(data),
        captions={"fronts": caption(data)},
    )  # fmt: skip
    return result | {"page": page["page"], "together": [row._asdict() for row in many], **measured(data)}
