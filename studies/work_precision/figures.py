"""The figures of the work-precision study with their captions."""

from collections import Counter

import xarray as xr

from symtop.measure import ranking
from symtop.measure.errors import QUANTITIES
from symtop.measure.phase import PARTS
from symtop.measure.work import TARGETS
from symtop.runner.study import Picture

from . import drawings, words
from .tables import Column

DECADES = tuple(10.0**-k for k in range(2, 14))
LEADERS = 9  # bold curves of the performance profiles
ALWAYS_SHOWN = ("midpoint", "stormer-verlet", "rk4", "rk45-compiled", "rk45")
PARTS_OF = ("midpoint", "stormer-verlet", "takahashi-imada", "rk4", "rk45-compiled", "gauss-8")
WALL_TIME, EVALUATIONS = "wall time of one run (s)", "force evaluations of one run"


def pictures(data: xr.Dataset) -> list[Picture]:
    """Fronts at both horizons, the fastest methods, profiles, energy at the long horizon, and parts of the error."""
    return [
        _front(data, "front-short", 0, Column.SECONDS, WALL_TIME),
        _front(data, "front-long", -1, Column.SECONDS, WALL_TIME),
        _front(data, "front-evaluations", 0, Column.EVALUATIONS, EVALUATIONS),
        _winners(data),
        _profiles(data),
        _energy(data),
        _parts(data),
    ]


def _front(data: xr.Dataset, name: str, far: int, cost: str, label: str) -> Picture:
    labels = (label, f"largest {QUANTITIES['axis']}")
    figure, names = drawings.fronts(data.isel(horizon=far), Column.AXIS, cost, labels)
    times = " A time is measured where the run was a contender for the fastest, and predicted elsewhere."
    return Picture(
        name,
        figure,
        f"Largest axis error {words.spans(data)[far]} against {label}. Each thin line is a method. The black step line "
        "is the front of the compiled methods: none of their runs is below or left of it. On it are "
        f"{', '.join(names)}. Dashed: methods whose inner loop is plain Python, with a front of their own. Grey band: "
        f"below the error bound of the reference.{times if cost == Column.SECONDS else ''}",
        f"Log-log work-precision plots of the axis error against {label}, one panel a scene.",
    )


def _winners(data: xr.Dataset) -> Picture:
    scenes = [str(name) for name in data["scene"].values]
    wins = ranking.winners(data, DECADES)
    kept, uncounted = ranking.counted(data)
    counting = [won for key, won in wins.items() if key[0] in kept["scene"].values]
    count = Counter(won.best.integrator for won in counting if won)
    most = ", ".join(f"{name} ({times})" for name, times in count.most_common(4))
    return Picture(
        "winners",
        drawings.winner_strips(wins, scenes, words.spans(data), DECADES),
        f"The fastest compiled method for each decade of axis error. Most often: {most}, of {len(counting)} cells."
        f"{words.left_out(uncounted)} Pale and with a tilde: its lead over at least one other method is within the "
        "noise. Methods were timed against each other at 1e-3, 1e-6, 1e-9 and 1e-12; in between some times are "
        "predicted.",
        "Coloured strips naming the fastest method, a row a scene, a column a decade of accuracy.",
    )


def _profiles(data: xr.Dataset) -> Picture:
    kept = ranking.counted(data)[0]
    tiers = {str(name): data[Column.IMPLEMENTATION].sel(integrator=name).values for name in data["integrator"].values}
    names = [name for name, tier in tiers.items() if "compiled" in tier]
    ratios = ranking.relative(ranking.costs(kept), names)
    shown = ranking.leaders(ratios.sel(integrator=names), LEADERS)
    shown += [name for name in ALWAYS_SHOWN if name not in shown]
    return Picture(
        "profiles",
        drawings.profiles(ratios, shown, [f"axis error {target:.0e}" for target in TARGETS]),
        f"Share of the {ratios.sizes['problem']} pairs of scene and horizon on which a method meets a target within a "
        "factor (horizontal) of the fastest compiled method's time. A curve's left end is the share on which the "
        "method is the fastest; its right end is the share on which it meets the target at all, within its budget of "
        "force evaluations and a thousand times the fastest time. Closest to the fastest over all targets is "
        f"{shown[0]}, then {', '.join(shown[1:4])}.",
        "Performance profiles at four targets, one curve a method.",
    )


def _energy(data: xr.Dataset) -> Picture:
    labels = (WALL_TIME, f"largest {QUANTITIES['energy']}")
    methods = [*words.STRUCTURE, *words.CLASSIC]
    return Picture(
        "energy-long",
        drawings.small_multiples(data.isel(horizon=-1), methods, Column.ENERGY, Column.SECONDS, labels, (1e-16, 30.0)),
        f"Energy error {words.spans(data)[-1]} against {WALL_TIME}. {words.crossed(data)}",
        "Log-log plots of energy error against time at the long horizon for six methods, one panel a scene.",
    )


def _parts(data: xr.Dataset) -> Picture:
    name = str(data["scene"].values[0])
    scene = data.sel(scene=name)
    cells = {f"{name}, {words.spans(data)[far]}": scene.isel(horizon=far) for far in (0, -1)}
    first, last = (f"{data['horizon'].values[far]:g}" for far in (0, -1))
    return Picture(
        "parts",
        drawings.few_curves(cells, PARTS_OF, PARTS, Column.EVALUATIONS, EVALUATIONS),
        f"Parts of the axis error on {name}: distance from the true path (shape), and how far the run is behind or "
        f"ahead of the truth in its nutation and in its precession (lags). From {first} to {last} nutation periods, at "
        "equal step or tolerance, the shape error grows by a factor of "
        f"{words.growth(scene, PARTS_OF, Column.SHAPE)}; the nutation lag by a factor of "
        f"{words.growth(scene, PARTS_OF, Column.NUTATION_LAG)}.",
        "Shape error, nutation lag and precession lag against work at two horizons.",
    )
