"""Splitting: drift and kick in a chart, composed by a table of coefficients.

In the angles chart the reduced Hamiltonian separates, ``H = p_theta^2/2 I1 + V(theta; p_phi, p_psi) + p_psi^2/2 I3``:

    kick(b h):   p_theta -= b h V',  phi += b h phi'(theta),  psi += b h psi'(theta)     (flow of V, theta fixed)
    drift(a h):  theta += a h p_theta / I1                                               (flow of p_theta^2/2 I1)

phi and psi move in the kick because V depends on p_phi and p_psi. A composition alternates kicks b_0 .. b_n with
drifts a_1 .. a_n. Every such method is explicit and symplectic, keeps p_phi and p_psi exactly, and is symmetric if
its coefficients are; the last kick and the first one of the next step share one force evaluation.
`stormer-verlet` is kick-drift-kick, (1/2, 1, 1/2): order 2, one sine and one cosine a step, stable for
h omega < 2. It is not the trapezoidal discrete Lagrangian, which is implicit.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, sections I.1.4 and II.5.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.cpython.unsafe.tuple import tuple_setitem

from symtop import top as model
from symtop.checks import SymtopError, finite
from symtop.integrators.angles import chart_outcome, reduced
from symtop.integrators.compiled import register_jitable
from symtop.integrators.drive import driver
from symtop.integrators.fixed_step import fixed_step
from symtop.integrators.registry import Integrator


class Composition(NamedTuple):
    """Coefficients of kick b_0, drift a_1, kick b_1, ... drift a_n, kick b_n, in units of the step."""

    drift: tuple[float, ...]
    kick: tuple[float, ...]


effective_force = register_jitable(model.effective_force)


@register_jitable
def force_angles(par: Any, state: Any, step: Any) -> Any:
    """V', phi' and phi' cos(theta) at the present theta."""
    slope, precession, cosine = effective_force(state[0] + step[0], par.north, par.south, par.I1, par.mgl)
    return slope, precession, precession * cosine


@register_jitable
def kick_angles(par: Any, force: Any, step: Any, tau: float) -> Any:
    """Flow of the potential for a time tau."""
    slope, precession, turn = force
    return (
        step[0],
        step[1] - tau * slope,
        step[2] + tau * precession,
        step[3] + tau * (par.p_psi / par.I3 - turn),
    )


@register_jitable
def drift_angles(par: Any, state: Any, step: Any, tau: float) -> Any:
    """Free flight for a time tau."""
    return (step[0] + tau * (state[1] + step[1]) / par.I1, step[1], step[2], step[3])


@register_jitable
def compose(force: Any, kick: Any, drift: Any, par: Any, rule: Any, state: Any, at_start: Any, h: float) -> Any:
    """Increment of one step and the force at its end. A force nobody kicks with is not evaluated."""
    step = state
    for i in range(len(state)):
        step = tuple_setitem(step, i, 0.0)
    now = at_start
    stages = len(rule.drift)
    for i in range(stages):
        step = kick(par, now, step, rule.kick[i] * h)
        step = drift(par, state, step, rule.drift[i] * h)
        if rule.kick[i + 1] != 0.0:
            now = force(par, state, step)
    return kick(par, now, step, rule.kick[stages] * h), now


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The force at the start."""
    return force_angles(par, state, (0.0, 0.0, 0.0, 0.0))


def increment(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (theta, p_theta, phi, psi); the work counted is the number of force evaluations."""
    step, force = compose(force_angles, kick_angles, drift_angles, par, rule, state, carry, h)
    return step, force, len(rule.drift), chart_outcome(state[0] + step[0])


def observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi from the increments of phi and psi, which are linear in them.

    With k = (1/I3 - 1/I1)/2, a = sum b/(4 I1 sin^2 x), d = sum b/(4 I1 cos^2 x), x = theta/2 at the kicks:
    (dphi + dpsi)/h = (k + 2d) south - k north,  (dphi - dpsi)/h = (k + 2a) north - k south.
    """
    step = (0.0, 0.0, 0.0, 0.0)
    a = d = 0.0
    stages = len(rule.drift)
    for i in range(stages + 1):
        theta = before[0] + step[0]
        sin_x, cos_x = np.sin(0.5 * theta), np.cos(0.5 * theta)
        a += rule.kick[i] / (4.0 * par.I1 * sin_x * sin_x)
        d += rule.kick[i] / (4.0 * par.I1 * cos_x * cos_x)
        if i < stages:
            step = kick_angles(par, force_angles(par, before, step), step, rule.kick[i] * h)
            step = drift_angles(par, before, step, rule.drift[i] * h)
    k = 0.5 * (1.0 / par.I3 - 1.0 / par.I1)
    plus, minus = (dstate[2] + dstate[3]) / h, (dstate[2] - dstate[3]) / h
    determinant = 2.0 * k * (a + d) + 4.0 * a * d
    north = ((k + 2.0 * d) * minus + k * plus) / determinant
    south = ((k + 2.0 * a) * plus + k * minus) / determinant
    return 0.5 * (north + south), 0.5 * (south - north)


march = driver(begin, increment, observe)


def composition(
    name: str,
    drift: Sequence[float],
    kick: Sequence[float],
    *,
    order: int | None = None,
    summary: str = "",
    reference: str = "",
) -> Integrator:
    """A splitting method from its coefficients: kick[0], drift[0], kick[1], ... drift[-1], kick[-1].

    Both must sum to 1. The middle coefficient of each is reset to one minus the sum of the others: a sum
    that is wrong by one rounding is a systematic error that grows with time.
    """
    if len(kick) != len(drift) + 1 or not drift:
        msg = f"kick must have one coefficient more than drift, not {len(kick)} against {len(drift)}"
        raise SymtopError(msg)
    tables = []
    for label, table in (("drift", drift), ("kick", kick)):
        values = [finite(f"a {label} coefficient", value) for value in table]
        if abs(math.fsum(values) - 1.0) > 1e-12:
            msg = f"{label} coefficients must sum to 1, not {math.fsum(values)!r}"
            raise SymtopError(msg)
        tables.append(values)
    drifts, kicks = (_exact_sum(values) for values in tables)
    symmetric = drifts == drifts[::-1] and kicks == kicks[::-1]
    rule = Composition(drifts, kicks)
    return Integrator(
        name=name,
        family="splitting",
        summary=summary or f"splitting with {len(drifts)} drifts",
        solvers={"angles": fixed_step(march, rule, reduced, 1, implicit=False)},
        order=order,
        explicit=True,
        symplectic=True,
        symmetric=symmetric,
        conserves=frozenset({"p_phi", "p_psi"}),
        reference=reference,
    )


def _exact_sum(values: list[float]) -> tuple[float, ...]:
    """The same coefficients with the middle one (or the middle two, equally) closing the sum to 1."""
    n = len(values)
    middle = range((n - 1) // 2, n // 2 + 1)
    others = math.fsum(value for i, value in enumerate(values) if i not in middle)
    return tuple((1.0 - others) / len(middle) if i in middle else value for i, value in enumerate(values))


def built_in() -> list[Integrator]:
    """The compositions that ship with symtop."""
    return [
        composition(
            "stormer-verlet",
            (1.0,),
            (0.5, 0.5),
            order=2,
            summary="kick-drift-kick splitting of the reduced Hamiltonian",
            reference="hairer-lubich-wanner-2003",
        ),
    ]
