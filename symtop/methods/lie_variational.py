"""Variational integrators on the rotation group: Lee, Leok and McClamroch's, and discrete Euler-Poincare's.

A step of length h is a kick by half of gravity's impulse, a rotation that a discrete Lagrangian of the free body gives,
and the other half of the kick:

    L += h tau(e)/2;     a = (h/2) L,   solve a = A(u) for the Cayley vector u,   q <- (1, u) q/sqrt(1 + u^2);
    L += h tau(e)/2.

With J the inertia in space at the start of the step, J x = I1 x + (I3 - I1)(e.x) e,

    Moser-Veselov     a = (J u + u x J u)/(1 + u^2)           action tr((1 - F) J_d)/h, F = R_0^T R_1: J_d is not J
    Euler-Poincare    a = J u + u x J u + (u.J u) u           action h W.J W/2 with h W = 2 u: Cayley's retraction

The first is the discrete rigid body of Moser and Veselov, in the form h Pi = F J_d - J_d F^T of Lee, Leok and
McClamroch; with the kicks it is their Lie-group variational integrator. RATTLE on the body's three directors, with the
mass matrix J_d and the constraint that they are orthonormal, is the same map (McLachlan, Zanna 2005; a test steps it).

Symmetry makes three equations one. With d = I3 - I1, x = u.e, u = x e + u' and a = A e + a', both are j x = n A and
i u' + d x u' x e = n a', and what is left is an equation for one number,

    Moser-Veselov     n = 1 + u^2,     i = I1,       j = I3          Newton's from n = 1, monotone
    Euler-Poincare    k = u.J u,       i = I1 + k,   j = I3 + k,     n = 1         from k = 0, in an interval

The first has no solution where a body with I1 = I3 would have to turn by more than a right angle, h|L| > I1, and a run
ends there as `not_converged`; the second has one at any step. Both are symplectic, symmetric and of order 2; p_phi and
p_psi are kept by Noether's theorem. Five steps with Suzuki's shares are of order 4. The body's spin is turned in the
step, by arcsin(h psi') with the first and too little by (h psi')^3/3 with the second.
Sources: Moser, Veselov, Commun. Math. Phys. 139 (1991) 217; Lee, Leok, McClamroch, Comput. Methods Appl. Mech. Eng. 196
(2007) 2907; Bou-Rabee, Marsden, Found. Comput. Math. 9 (2009) 197; McLachlan, Zanna, Found. Comput. Math. 5 (2005) 87.
"""

from typing import Any, NamedTuple

from symtop.base.compiled import register_jitable
from symtop.methods.coefficients import SUZUKI_4
from symtop.methods.engine_parts import cross, dot, plus, scaled
from symtop.methods.lanes import Lanes
from symtop.methods.lie_lanes import iterated
from symtop.methods.lie_loop import SPUN, cayley, gravity, in_both_charts, lie_loop, moved
from symtop.methods.outcomes import NOT_CONVERGED, OK
from symtop.methods.registry import Integrator

MOST = 60  # iterations of a step; 2 to 5 are the rule
ENOUGH = 1e-10  # a relative correction whose square is below rounding
MOSER_VESELOV, EULER_POINCARE = 0.0, 1.0


class Variational(NamedTuple):
    """Which discrete Lagrangian, and the parts that a step is composed of."""

    kind: float
    shares: tuple[float, ...] = (1.0,)


@register_jitable
def _moser_veselov_pass(par: Any, A: float, square: float, n: float) -> Any:
    """Newton's next n of the discrete rigid body, whether it is the last, and whether there is none."""
    d, rate = par.I3 - par.I1, A / par.I3
    along = rate * rate * n * n
    D = par.I1 * par.I1 + d * d * along
    gap = 1.0 + along + square * n * n / D - n
    slope = 1.0 - 2.0 * along / n - 2.0 * square * n * par.I1 * par.I1 / (D * D)
    after = n + gap / slope
    return after, gap <= ENOUGH * slope * after, not slope > 0.0


@register_jitable
def _moser_veselov(par: Any, A: float, square: float) -> Any:
    """n, i and x of the discrete rigid body, iterations, and did they converge."""
    n, rate = 1.0, A / par.I3
    for k in range(MOST):
        n, ended, lost = _moser_veselov_pass(par, A, square, n)
        if ended or lost:
            return n, par.I1, rate * n, k + 1, not lost
    return n, par.I1, rate * n, MOST, False


@register_jitable
def _euler_poincare_pass(par: Any, A: float, square: float, k: float, low: float, high: float) -> Any:
    """The next k of Cayley's retraction and its interval, and whether it is the last; its middle where Newton leaves it.
    """
    d, i, j = par.I3 - par.I1, par.I1 + k, par.I3 + k
    x = A / j
    bent = d * d * x * x
    D = i * i + bent
    gap = par.I1 * square / D + par.I3 * x * x - k
    slope = 1.0 + 2.0 * par.I1 * square * (i - bent / j) / (D * D) + 2.0 * par.I3 * x * x / j
    low, high = (k, high) if gap > 0.0 else (low, k)
    after = k + gap / slope
    after = after if low <= after <= high else 0.5 * (low + high)
    return after, low, high, abs(after - k) <= ENOUGH * j


@register_jitable
def _highest(par: Any, A: float, square: float) -> float:
    """Above the k of Cayley's retraction."""
    highest: float = square / par.I1 + A * A / par.I3
    return highest


@register_jitable
def _euler_poincare(par: Any, A: float, square: float) -> Any:
    """The same of Cayley's retraction."""
    k, low, high = 0.0, 0.0, _highest(par, A, square)
    for number in range(MOST):
        k, low, high, ended = _euler_poincare_pass(par, A, square, k, low, high)
        if ended:
            return 1.0, par.I1 + k, A / (par.I3 + k), number + 1, True
    return 1.0, par.I1 + k, A / (par.I3 + k), MOST, False


@register_jitable
def _kicked(par: Any, e: Any, L: Any, half: float) -> Any:
    """Half a step's momentum after half of the kick, a: what is across the axis and what is along it."""
    a = scaled(half, plus(L, 1.0, scaled(half, gravity(par, e))))
    A = dot(a, e)
    return plus(a, -A, e), A


@register_jitable
def _rotated(par: Any, e: Any, across: Any, half: float, n: float, i: float, x: float) -> Any:
    """The rotation of n, i and x, and the change of L with both halves of the kick."""
    bent = (par.I3 - par.I1) * x
    side = plus(scaled(i, across), -bent, cross(across, e))
    u = plus(scaled(x, e), n / (i * i + bent * bent), side)
    m, v = cayley(u)
    kick = scaled(half, gravity(par, e))
    return m, v, plus(kick, half, gravity(par, plus(e, 1.0, moved(m, v, e))))


def turn(par: Any, rule: Any, e: Any, L: Any, carry: Any, h: float) -> Any:
    """One step; the work counted is the number of Newton iterations."""
    half = 0.5 * h
    across, A = _kicked(par, e, L, half)
    square = dot(across, across)
    if rule.kind == MOSER_VESELOV:
        n, i, x, work, converged = _moser_veselov(par, A, square)
    else:
        n, i, x, work, converged = _euler_poincare(par, A, square)
    m, v, dL = _rotated(par, e, across, half, n, i, x)
    return m, v, dL, work, OK if converged else NOT_CONVERGED


@register_jitable
def _opened(par: Any, e: Any, L: Any, h: float) -> Any:
    """The axis, what lies across it, what lies along it and the square of the former."""
    across, A = _kicked(par, e, L, 0.5 * h)
    return (*e, *across, A, dot(across, across))


def _moser_veselov_start(par: Any, rule: Any, e: Any, L: Any, carry: Any, h: float) -> Any:
    return _opened(par, e, L, h), (1.0,)


def _moser_veselov_again(par: Any, rule: Any, carry: Any, h: float, opened: Any, x: Any) -> Any:
    n, ended, lost = _moser_veselov_pass(par, opened[6], opened[7], x[0])
    return (n,), ended, lost


def _moser_veselov_close(par: Any, rule: Any, carry: Any, h: float, opened: Any, x: Any) -> Any:
    n, rate = x[0], opened[6] / par.I3
    return (*_rotated(par, opened[:3], opened[3:6], 0.5 * h, n, par.I1, rate * n), carry)


def _euler_poincare_start(par: Any, rule: Any, e: Any, L: Any, carry: Any, h: float) -> Any:
    opened = _opened(par, e, L, h)
    return opened, (0.0, 0.0, _highest(par, opened[6], opened[7]))


def _euler_poincare_again(par: Any, rule: Any, carry: Any, h: float, opened: Any, x: Any) -> Any:
    k, low, high, ended = _euler_poincare_pass(par, opened[6], opened[7], *x)
    return (k, low, high), ended, False


def _euler_poincare_close(par: Any, rule: Any, carry: Any, h: float, opened: Any, x: Any) -> Any:
    k = x[0]
    return (*_rotated(par, opened[:3], opened[3:6], 0.5 * h, 1.0, par.I1 + k, opened[6] / (par.I3 + k)), carry)


_RIGID_BODY = iterated(
    _moser_veselov_start, _moser_veselov_again, _moser_veselov_close, MOST, opened=8, unknowns=1
)
_RETRACTION = iterated(
    _euler_poincare_start, _euler_poincare_again, _euler_poincare_close, MOST, opened=8, unknowns=3
)


def _in_lanes(rule: Variational) -> Lanes:
    return _RIGID_BODY if rule.kind == MOSER_VESELOV else _RETRACTION


march = lie_loop(turn, lanes=_in_lanes)


def lie_variational(name: str, rule: Variational, order: int, summary: str, reference: str) -> Integrator:
    """The variational integrator of a discrete Lagrangian and a composition."""
    return Integrator(
        name=name, family="discrete-lagrangian", summary=summary, reference=reference, order=order, explicit=False,
        symplectic=True, symmetric=True, conserves=frozenset({"p_phi", "p_psi", "axis_length"}),
        solvers=in_both_charts(march, rule, SPUN, 1, implicit=True),
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """Lee, Leok and McClamroch's integrator, its composition, and that of Cayley's retraction."""
    lee, cayley_map = "lee-leok-mcclamroch-2007 moser-veselov-1991 mclachlan-zanna-2005", "bou-rabee-marsden-2009"
    return [
        lie_variational(
            "lie-variational", Variational(MOSER_VESELOV), 2,
            "Lie-group variational integrator: kicks around a discrete rigid body of Moser and Veselov", lee,
        ),
        lie_variational(
            "lie-variational-suzuki-4", Variational(MOSER_VESELOV, SUZUKI_4.drift), 4,
            "five steps of the Lie-group variational integrator", f"{lee} suzuki-1990",
        ),
        lie_variational(
            "euler-poincare", Variational(EULER_POINCARE), 2,
            "discrete Euler-Poincare equations with Cayley's retraction, between kicks", cayley_map,
        ),
    ]  # fmt: skip
