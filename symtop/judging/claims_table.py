"""The finding on a table, Butcher's or a splitting's: its order conditions, which need no run, before what runs show.

A condition of order k that is off by d adds an error of d (w h)^k to a step, w = 2 pi/nutation, beside d' (w h)^(p+1),
which a method of order p has anyway: a slope shows it below w h = (d/d')^(1/(p + 1 - k)), often a step that is so
small that rounding is larger. The conditions show it at any d beyond rounding.
"""

import math
from typing import Any

from symtop.judging.findings import Finding
from symtop.measure import splitting_conditions as splitting
from symtop.measure.order_conditions import Conditions, conditions, triangle
from symtop.methods.framework.fixed_step import FixedStep
from symtop.methods.framework.preparation import Scaled
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.explicit import Tableau
from symtop.methods.splitting.loop import Composition
from symtop.methods.splitting.rotor import EXACT
from symtop.model.scenes import Scene


def table_of(method: Integrator) -> Conditions | None:
    """The conditions of an explicit Runge-Kutta method of fixed step or a splitting into two flows, None for any other.

    A splitting whose drift is a Cayley map has no table of this kind: its drift is no flow.
    """
    for solver in method.solvers.values():
        rule: Any = solver.rule if isinstance(solver, FixedStep) else None
        rule = rule.rule if isinstance(rule, Scaled) else rule
        if isinstance(rule, Tableau):
            return conditions(triangle(rule.a, len(rule.b)), rule.b)
        if isinstance(rule, Composition) and rule.turn == EXACT:
            return splitting.conditions(rule.drift, rule.kick, rule.gradient, rule.processor)
    return None


def with_table(finding: Finding, method: Integrator, scene: Scene) -> Finding:
    """The finding on the order, with what the table says before it; a table that misses the order refutes it."""
    table = table_of(method)
    if table is None or finding.verdict == "inapplicable":
        return finding
    power = method.order or table.order
    words = table.words(power)
    missed = table.order < min(power, len(table.defect))
    if missed:
        words += seen_from(table, power, scene)
    verdict = "refuted" if missed else finding.verdict
    return finding._replace(verdict=verdict, why=f"{words}; {finding.why}")


def seen_from(table: Conditions, power: int, scene: Scene) -> str:
    """From which step on a slope would show the condition that is missed; empty where that is not known."""
    low, high = table.order + 1, power + 1
    if low >= high or high > len(table.defect) or table.defect[high - 1] == 0.0:
        return ""
    turn = (table.defect[low - 1] / table.defect[high - 1]) ** (1.0 / (high - low))
    return f" (slopes show it from steps of {turn * scene.time_scale() / (2.0 * math.pi):.0e} downwards)"
