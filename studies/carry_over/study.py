"""Which verdicts on the symmetric top carry over to a body without symmetry, and by what factor?

This docstring is the plan, stated before the first full run; the page says where the results differ from it.

*Populations* (`bodies`): heavy bodies at a distance epsilon from Lagrange's top in moments and centre of mass, the
same draws at every epsilon of 0, 0.01, 0.03, 0.1, 0.3; chaotic ones at 0.3; free ones, near symmetric to needles. 400
of each over 10 natural periods, and the first 100 over 100, each with the targets that its reference can judge.
*Methods*: all compiled ones in the chart `body`, by what they need of a user; and on the bodies of epsilon = 0, as
tops, the same methods in their smallest chart of the top.
*Measured* by the ladder of settings, the prices and the two protocols of the study of cost: the error of the axis (the
direction of the centre of mass, of a free body the third axis), with the attitude beside it.

*The claim* is that how errors grow and which methods are good carries over, and sizes of steps and times do not. It is
refuted for a kind of bodies, and withdrawn there, where

    ranking     Kendall's tau of the methods' median costs with those at epsilon = 0 is below `PART` with its whole
                interval. It carries over where all of the interval is above `SAME`, and in part between. The ceiling
                is tau between two halves of the bodies at epsilon = 0; intervals are a bootstrap over bodies and
                prices
    winner      the winner at epsilon = 0 costs more than `DOUBLE` times the best of each body in the median; it
                carries over up to `LEVEL` times, with a factor between
    steps       of a class, the safe steps a period (for 95 % of the bodies) over those at epsilon = 0: it carries over
                up to `LEVEL`, with a factor up to `DOUBLE`, and not beyond, by the method that grows most of 20
    own step    the same for the steps of the top's own charts: is the number in the README valid for the body?
    silent      of the runs at `STEPS` steps a period, the share that is off by more than 0.1 rad with energy and
                momenta kept to 1 %: it carries over within a factor `LEVEL`, with a factor within `SEVERAL`
    growth      exponents of attitude and energy errors with time on regular bodies are off by more than `EXPONENT`
    order       the order seen between the two finest settings is lower by more than `LOWER`

Of the targets of a family the worst decides. Prices of kernels that use the symmetry are expected not to carry over:
their ratio is reported. Linear limits, resonances and the maps of engines are not part of this plan.

*Addendum*, written after the first full run and before any of the following was measured (`limits`). Steady bodies: 24
bodies a family, the same draws at every epsilon, turn upright about the third axis, with the centre of mass on it and
1.5 to 4 times as fast as a top that just sleeps; moments 1, 1 + epsilon u and I3, which is the least or the largest in
turn; free ones without a weight, up to strongly asymmetric. The methods are those of `growth`, in the chart `body`.
Maps of engines in the chart `body` run on the first 24 of each family of the plan, with 70 and 280 steps a period for
ten periods. omega is the fastest frequency of small oscillations about the rotation, in the axes of the body. Refuted
by

    limit       h omega, at which the linearised step first lets a displacement grow by 1e-4 a step (`stability` has the
                same threshold), over that of the same draw at epsilon = 0, 10 where none is below: the factor that 5 %
                of methods and bodies fall below; carries over within `LEVEL`, with a factor within `DOUBLE`
    resonances  of 60 even steps below that limit the share at which a tilt of 0.05 rad comes twice as far as small
                oscillations can, within 300 steps; the mean over methods and bodies, 1 % if it is less: carries over
                within a factor `LEVEL`, with a factor within `SEVERAL`
    engines     tau of the medians of the axis' largest error with that at epsilon = 0, as for `ranking`, and the share
                of bodies lost at once, off by more than 0.1 rad within the first period, as for `silent`; the worse of
                both, and of both steps
"""

from typing import Any

import xarray as xr
from symtop_studies.cost.prices import BATCHES, PROCESSES, measured

from symtop.methods.framework.registry import Integrator, engines, integrator, methods
from symtop.model.charts import BODY
from symtop.runner.study import Case, Study

from . import comparison, facts, figures
from .bodies import FAMILIES, bodies_of
from .limits import engine_table, steady_table
from .measures import GROWN, about, growth_table, own_table, table

SEED = 1
SHORT, LONG, OWN, BODIES, GROWTH, PRICES = "short", "long", "own", "bodies", "growth", "prices"  # groups of cases
STEADY, ENGINES = "steady", "engines"
LEFT_OUT = ("taylor-longdouble", "taylor-quad")  # the same steps as taylor in slower arithmetic
FULL: dict[str, dict[str, Any]] = {
    SHORT: {"count": 400, "periods": 10.0, "seed": SEED, "budget": 2.5e4},
    LONG: {"count": 100, "periods": 100.0, "seed": SEED, "budget": 6e4},
    GROWTH: {"count": 40, "doublings": 6, "seed": SEED},
    STEADY: {"count": 24, "seed": SEED, "grid": 0.02, "places": 60},
    ENGINES: {"count": 24, "periods": 10.0, "seed": SEED},
}
QUICK: dict[str, dict[str, Any]] = {
    SHORT: {"count": 7, "periods": 10.0, "seed": SEED, "budget": 1.0e3},
    LONG: {"count": 5, "periods": 20.0, "seed": SEED, "budget": 2e3},
    GROWTH: {"count": 4, "doublings": 3, "seed": SEED},
    STEADY: {"count": 4, "seed": SEED, "grid": 0.4, "places": 8},
    ENGINES: {"count": 5, "periods": 10.0, "seed": SEED},
}


def of_bodies() -> list[Integrator]:
    """The compiled methods with a step or a tolerance in the chart `body`, in that chart alone."""
    return [
        integrator(f"{name}[{BODY}]") for name, method in methods().items()
        if BODY in method.solvers and method.implementation == "compiled" and method.control and name not in LEFT_OUT
    ]  # fmt: skip


def of_tops() -> list[Integrator]:
    """The same methods in their smallest chart that shows the axis of a top."""
    rows = [integrator(variant.method) for variant in of_bodies()]
    return [row.variant(row.chart_for("axis")) for row in rows if row.charts()]


def of_engines() -> list[str]:
    """The maps of engines that step a body without symmetry."""
    return [name for name, engine in engines().items() if BODY in engine.solvers]


def grid(*, quick: bool = False) -> list[Case]:
    """Every method on all bodies over ten periods, on the tops; growth; steady bodies; engines; prices; bodies."""
    settings, bodies, tops = QUICK if quick else FULL, of_bodies(), of_tops()
    timing = {
        "integrators": [variant.name for variant in (*bodies, *tops)], "rounds": 1 if quick else 4,
        "batch": 0.0002 if quick else 0.002,
    }  # fmt: skip
    return [
        *(Case("bodies", variant.name, settings[SHORT], group=SHORT) for variant in bodies),
        *(Case("tops", variant.name, settings[SHORT], group=OWN) for variant in tops),
        *(Case(span, "exact", settings[span], group=BODIES) for span in (SHORT, LONG)),
        *(Case("regular", f"{name}[{BODY}]", settings[GROWTH], group=GROWTH) for name in GROWN),
        *(Case("upright", f"{name}[{BODY}]", settings[STEADY], group=STEADY) for name in GROWN),
        *(Case("bodies", f"{name}[{BODY}]", settings[ENGINES], group=ENGINES) for name in of_engines()),
        *(Case(f"{BATCHES[0]}-{k}", "together", timing, timed=True, group=PRICES)
          for k in range(1 if quick else PROCESSES)),
    ]  # fmt: skip


def follow_up(data: xr.DataTree) -> list[Case]:
    """The long runs of the methods whose cost is near the least of their class."""
    settings = FULL if data[SHORT].sizes["member"] >= FULL[SHORT]["count"] else QUICK
    return [Case("bodies", name, settings[LONG], group=LONG) for name in comparison.contenders(data)]


def measure(case: Case) -> xr.Dataset:
    """The table of a method on bodies or tops, growth, limits, engines, prices, or facts about bodies."""
    settings = case.settings
    if case.group == PRICES:
        return measured(settings["integrators"], settings["rounds"], settings["batch"])
    if case.group == GROWTH:
        return growth_table(integrator(case.integrator), settings["count"], settings["doublings"], settings["seed"])
    if case.group == STEADY:
        return steady_table(integrator(case.integrator), **settings)
    families = {name: bodies_of(name, settings["count"], settings["seed"], settings["periods"]) for name in FAMILIES}
    if case.group == BODIES:
        return about(families, long=case.scene == LONG).assign(periods=settings["periods"])
    if case.group == ENGINES:
        return engine_table(integrator(case.integrator), families)
    make = own_table if case.group == OWN else table
    return make(integrator(case.integrator), families, settings["budget"])


STUDY = Study(
    name="carry_over",
    title="Carry over",
    question="My body is no symmetric top: which of these verdicts hold for it?",
    cases=lambda quick: grid(quick=quick), measure=measure, follow_up=follow_up,
    facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
    uses=lambda case: [*case.integrators, "series-general-adaptive"],  # the truth of heavy bodies
)  # fmt: skip
