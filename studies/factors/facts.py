"""Facts and tables of the study: the effect of one factor, as the ratio of two times that differ in it alone."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.methods.framework.registry import SMALLEST_FIRST

from .cells import (
    COMPILED,
    DORMAND_PRINCE,
    FAMILIES,
    KERNEL,
    NUMPY,
    SAMPLES,
    SCIPY_NUMBA,
    SCIPY_PYTHON,
    SCIPYS,
    SIMULATE,
    SOLVE_IVP,
    cells,
)  # fmt: skip
from .measures import LEAST, NOISY

NOISY_SHARE = 0.02  # limit on the share of noisy times; with more, no times are compared
TIE = 0.1  # relative: times that differ by less count as equal
GOAL = ["scene", "horizon", "target"]  # only times of the same goal are compared
FACTORS = ["method", "chart", "language", "call"]
USUAL = (DORMAND_PRINCE, "angles", SCIPY_PYTHON, SOLVE_IVP)
STEPS = (
    ("chart", "angles", "axis"),
    ("chart", "axis", "attitude"),
    ("language", SCIPY_PYTHON, SCIPY_NUMBA),
    ("language", SCIPY_NUMBA, COMPILED),
    ("language", NUMPY, COMPILED),
    ("call", SOLVE_IVP, SIMULATE),
    ("call", SIMULATE, KERNEL),
    ("method", DORMAND_PRINCE, "DOP853"),
    ("method", DORMAND_PRINCE, "rk4"),
    ("method", DORMAND_PRINCE, "Takahashi-Imada"),
    ("method", DORMAND_PRINCE, "Taylor"),
)
CHARTS = ("angles", "attitude")  # beside the axis
FAMILY = {scheme: family for family, schemes in FAMILIES.items() for scheme in schemes}
WATERFALL = ["factor", "from", "to", "variant", "call", "time (s)", "times faster", "so far", "spread"]


def timed(data: xr.Dataset) -> pd.DataFrame:
    """One row for each measured time: its goal, the levels of its four factors, its numbers."""
    names = ["seconds", "spread", "axis", "force_evaluations"]
    frame = data[names].to_dataframe().dropna(subset=["seconds"]).reset_index()
    known = {cell.name: cell.key for cell in cells()}
    levels = [known[name] for name in frame["variant"]]
    return frame.join(pd.DataFrame(levels, index=frame.index, columns=FACTORS[:3]))


def noisy(data: xr.Dataset) -> tuple[int, int]:
    """The number of times whose spread between processes is above `NOISY`, and the number of all times."""
    spread = data["spread"].values
    return int(np.sum(spread > NOISY)), int(np.isfinite(spread).sum())


def compared(data: xr.Dataset) -> pd.DataFrame:
    """The times that are compared: all, or none if too many are noisy because the machine was busy."""
    frame, (noisy_count, count) = timed(data), noisy(data)
    return frame.iloc[:0] if noisy_count > NOISY_SHARE * count else frame


def fastest(part: pd.DataFrame, call: str = KERNEL, language: str | None = None, tie: float = TIE) -> pd.Series | None:
    """The row with the least time of a call, in any or one language; of times within `tie` that of the smallest chart.

    So noise does not decide which chart the waterfall shows; the targets need the axis only.
    """
    table = part[(part["call"] == call) & (part["language"] == (language or part["language"]))]
    level = table[table["seconds"] <= (1.0 + tie) * table["seconds"].min()]
    return min((row for _, row in level.iterrows()), default=None,
               key=lambda row: (SMALLEST_FIRST["axis"].index(row["chart"]), row["seconds"]))  # fmt: skip


def waterfall(part: pd.DataFrame, *, call_first: bool = False) -> pd.DataFrame:
    """From SciPy's RK45 in angles, called by `solve_ivp`, to the fastest kernel; each line changes one factor.

    The call is changed to `simulate` first and to the bare kernel last, or to the bare kernel at once. Empty if a time
    on this path is missing.
    """
    known = {tuple(row[FACTORS]): row for _, row in part.iterrows()}
    end = fastest(part)
    if USUAL not in known or end is None:
        return pd.DataFrame(columns=WATERFALL)
    path = [
        ("call", KERNEL if call_first else SIMULATE),
        ("chart", end["chart"]),
        ("language", SCIPY_NUMBA),
        ("language", COMPILED),
        ("method", end["method"]),
        ("call", KERNEL),
    ]
    levels, lines = list(USUAL), [("", "", "", known[USUAL])]
    for factor, level in path:
        place = FACTORS.index(factor)
        before, levels[place] = levels[place], level
        if before == level:
            continue
        if tuple(levels) not in known:
            return pd.DataFrame(columns=WATERFALL)
        lines.append((factor, before, level, known[tuple(levels)]))
    seconds = np.array([run["seconds"] for *_, run in lines])
    ratios = [np.nan, *(seconds[:-1] / seconds[1:])]
    return pd.DataFrame(
        [[*line[:3], run["variant"], run["call"], run["seconds"], ratio, seconds[0] / run["seconds"], run["spread"]]
         for (*line, run), ratio in zip(lines, ratios, strict=True)],
        columns=WATERFALL,
    )  # fmt: skip


def first_goal(frame: pd.DataFrame) -> pd.DataFrame:
    """The times of the first goal, whose waterfalls are shown."""
    return frame[(frame[GOAL] == frame[GOAL].iloc[0]).all(axis=1)] if len(frame) else frame


def pairs(frame: pd.DataFrame) -> pd.DataFrame:
    """The ratio of every pair of times that differ in one factor alone, for the changes in `STEPS`."""
    frames = []
    for factor, before, after in STEPS if len(frame) else ():
        columns = [*GOAL, *(name for name in FACTORS if name != factor)]
        joined = frame[frame[factor] == before].merge(frame[frame[factor] == after], on=columns)
        frames.append(joined[columns].assign(factor=factor, before=before, after=after,
                                       ratio=joined["seconds_x"] / joined["seconds_y"]))  # fmt: skip
    return pd.concat(frames) if frames else pd.DataFrame(columns=["factor", "before", "after", "ratio"])


def effects(frame: pd.DataFrame) -> pd.DataFrame:
    """Count, median, least and largest of these ratios, for each change of a factor."""
    ratios = pairs(frame).groupby(["factor", "before", "after"], sort=False)["ratio"]
    return ratios.agg(["count", "median", "min", "max"]).reset_index()


def charts(frame: pd.DataFrame) -> pd.DataFrame:
    """Seconds of every compiled kernel that was timed in several charts, and their ratios to those on the axis."""
    names = ["angles", "axis", "attitude"]
    if frame.empty:
        return pd.DataFrame(columns=[*GOAL, "family", "method", *names, *(f"{name} / axis" for name in CHARTS)])
    kernels = frame[(frame["language"] == COMPILED) & (frame["call"] == KERNEL)]
    table = kernels.pivot_table("seconds", [*GOAL, "method"], "chart", sort=False).reindex(columns=names)
    table = table[table.notna().sum(axis=1) > 1].reset_index()
    table.insert(len(GOAL), "family", table["method"].map(FAMILY))
    return table.assign(**{f"{name} / axis": table[name] / table["axis"] for name in CHARTS})


def against_scipy(frame: pd.DataFrame) -> pd.DataFrame:
    """SciPy's methods, each in its fastest chart, and the fastest compiled variant: whole calls, and kernels alone."""
    rows = []
    for goal, part in frame.groupby(GOAL, sort=False):
        for scheme in SCIPYS:
            theirs = part[(part["method"] == scheme) & (part["language"] == SCIPY_PYTHON)]
            user, inner = (fastest(theirs, call, tie=0.0) for call in (SOLVE_IVP, KERNEL))
            ours, kernel = (fastest(part, call, COMPILED) for call in (SIMULATE, KERNEL))
            if user is not None and inner is not None and ours is not None and kernel is not None:
                rows.append([*goal, scheme, user["variant"], user["seconds"], ours["variant"], ours["seconds"],
                             user["seconds"] / ours["seconds"], kernel["variant"],
                             inner["seconds"] / kernel["seconds"]])  # fmt: skip
    header = [*GOAL, "method", "SciPy's", "solve_ivp (s)", "fastest, as called", "simulate (s)", "times, as called",
              "fastest kernel", "times, kernels"]  # fmt: skip
    return pd.DataFrame(rows, columns=header)


def facts(data: xr.Dataset) -> dict[str, Any]:
    """The waterfall, the largest effect of each factor, SciPy, the charts, and the noise of the times."""
    times, frame, (loud, count) = timed(data), compared(data), noisy(data)
    part, scipy, ratios = first_goal(frame), against_scipy(frame), charts(frame)
    values: dict[str, Any] = {
        "busy": times.shape != frame.shape or None,
        "times": count, "loud": loud, "noisy": NOISY, "usual_spread": times["spread"].median(),
        "again": int((data["seconds_tries"] > 1).sum()),
        "samples": SAMPLES, "tie": TIE, "near": LEAST, "near_share": (times["axis"] >= LEAST * times["target"]).mean(),
    }  # fmt: skip
    for name, call_first in (("late", False), ("first", True)):
        bars = waterfall(part, call_first=call_first)
        values |= {f"{name}_{factor}": bars["times faster"][bars["factor"] == factor].max() for factor in FACTORS}
    values |= _ends(part, waterfall(part), bars)
    for name, column in (("user", "times, as called"), ("author", "times, kernels")):
        values |= {f"{name}_least": scipy[column].min(), f"{name}_most": scipy[column].max()}
    in_all = ratios.dropna()  # medians of one set of methods
    for chart in CHARTS:
        middles = in_all.groupby("family")[f"{chart} / axis"].median()
        values |= {f"{chart}_{family.replace('-', '_').lower()}": middles.get(family) for family in FAMILIES}
    return values


def _ends(part: pd.DataFrame, bars: pd.DataFrame, bare: pd.DataFrame) -> dict[str, Any]:
    """Goal, beginning and end of both waterfalls: of whole calls, and of the bare solvers."""
    if bars.empty or bare.empty:
        return dict.fromkeys(
            (*GOAL, "start", "start_time", "end", "end_time", "called", "bare_start", "bare_end", "bare", "around")
        )
    first, last = bars.iloc[0], bars.iloc[-2]  # before the call is changed to the kernel
    start, end = bare.iloc[1]["time (s)"], bare.iloc[-1]["time (s)"]
    return dict(part[GOAL].iloc[0]) | {
        "start": first["variant"], "start_time": first["time (s)"], "end": last["variant"],
        "end_time": last["time (s)"], "called": last["so far"],
        "bare_start": start, "bare_end": end, "bare": start / end, "around": last["time (s)"] - end,
    }  # fmt: skip


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """The effects, SciPy, the charts, and every time, or the reason why a cell has none."""
    frame = compared(data)
    reasons = data["reason"].to_dataframe().reset_index().query(f"{'reason'} != ''")
    times = {"axis": "error reached (rad)", "seconds": "time (s)", "force_evaluations": "force evaluations"}
    all_times = pd.concat([timed(data).drop(columns=FACTORS[:3], errors="ignore"), reasons]).rename(columns=times)
    frames = {"effects": effects(frame), "scipy": against_scipy(frame), "charts": charts(frame), "times": all_times}
    names = {"horizon": "nutations", "target": "axis error (rad)", "before": "from", "after": "to", "count": "pairs"}
    return {name: table.rename(columns=names) for name, table in frames.items()}
