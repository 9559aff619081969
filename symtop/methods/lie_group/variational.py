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

A body without symmetry leaves three equations for u, in its own axes, and Newton's method from u = J^-1 a.
The first has no solution where a body with I1 = I3 would have to turn by more than a right angle, h|L| > I1, and a run
ends there as `not_converged`; the second has one at any step. Both are symplectic, symmetric and of order 2; p_phi and
p_psi are kept by Noether's theorem. Five steps with Suzuki's shares are of order 4. The body's spin is turned in the
step, by arcsin(h psi') with the first and too little by (h psi')^3/3 with the second.
Sources: Moser, Veselov, Commun. Math. Phys. 139 (1991) 217; Lee, Leok, McClamroch, Comput. Methods Appl. Mech. Eng. 196
(2007) 2907; Bou-Rabee, Marsden, Found. Comput. Math. 9 (2009) 197; McLachlan, Zanna, Found. Comput. Math. 5 (2005) 87.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.methods.framework.body import observe_turned, torque
from symtop.methods.framework.loop import Loop
from symtop.methods.framework.registry import Integrator
from symtop.methods.lie_group.loop import SPUN, TURNED, cayley, gravity, in_charts, iterated_loop, moved
from symtop.methods.splitting.coefficients import SUZUKI_4
from symtop.methods.vectors import cross, dot, plus, scaled, solve3

MOST_SWEEPS = 60  # limit on the iterations of a step; 2 to 5 are usual
CONVERGED_CORRECTION = 1e-10  # a relative correction whose square is below rounding
MOSER_VESELOV, EULER_POINCARE = 0.0, 1.0


class Variational(NamedTuple):
    """Which discrete Lagrangian, and the parts that a step is composed of."""

    kind: float
    shares: tuple[float, ...] = (1.0,)


def _next_n(par: Any, A: float, square: float, x: Any) -> Any:
    """Newton's next n, whether it is the last, and whether there is none."""
    d, rate, n = par.I3 - par.I1, A / par.I3, x[0]
    along = rate * rate * n * n
    D = par.I1 * par.I1 + d * d * along
    gap = 1.0 + along + square * n * n / D - n
    slope = 1.0 - 2.0 * along / n - 2.0 * square * n * par.I1 * par.I1 / (D * D)
    n += gap / slope
    return (n,), gap <= CONVERGED_CORRECTION * slope * n, not slope > 0.0


def _next_k(par: Any, A: float, square: float, x: Any) -> Any:
    """Newton's next k, the middle of the interval where that leaves it, and whether it is the last."""
    k, low, high = x
    d, i, j = par.I3 - par.I1, par.I1 + k, par.I3 + k
    x = A / j
    bent = d * d * x * x
    D = i * i + bent
    gap = par.I1 * square / D + par.I3 * x * x - k
    slope = 1.0 + 2.0 * par.I1 * square * (i - bent / j) / (D * D) + 2.0 * par.I3 * x * x / j
    low, high = (k, high) if gap > 0.0 else (low, k)
    after = k + gap / slope
    after = after if low <= after <= high else 0.5 * (low + high)
    return (after, low, high), abs(after - k) <= CONVERGED_CORRECTION * j, False


# The equation for one number, in functions of what a holds along the axis and of the square of what lies across:
#     first(par, A, square) -> x
#     after(par, A, square, x) -> (x, converged, failed) one iteration
#     rates(par, A, x) -> (n, i, x)
RIGID_BODY = (lambda _par, _A, _square: (1.0,)), _next_n, (lambda par, A, x: (x[0], par.I1, A / par.I3 * x[0]))
RETRACTION = (  # k from 0 in the interval that it lies in
    lambda par, A, square: (0.0, 0.0, square / par.I1 + A * A / par.I3),
    _next_k,
    lambda par, A, x: (1.0, par.I1 + x[0], A / (par.I3 + x[0])),
)


def _loop(first: Callable[..., Any], after: Callable[..., Any], rates: Callable[..., Any], unknowns: int) -> Loop:
    """The step by one of the two equations, with so many numbers in x: for one, and in lanes."""
    for function in (first, after, rates):
        register_jitable(function)

    def start(par, rule, e, L, carry, h):  # type: ignore[no-untyped-def]
        """Half a step's momentum after half of the kick, a: across the axis and along it."""
        a = scaled(0.5 * h, plus(L, 1.0, scaled(0.5 * h, gravity(par, e))))
        A = dot(a, e)
        across = plus(a, -A, e)
        square = dot(across, across)
        return (*e, *across, A, square), first(par, A, square)

    def iterate(par, rule, carry, h, fixed, x):  # type: ignore[no-untyped-def]
        return after(par, fixed[6], fixed[7], x)

    def close(par, rule, carry, h, fixed, x):  # type: ignore[no-untyped-def]
        """The rotation, and the change of L with both halves of the kick."""
        (n, i, along), e, across, half = rates(par, fixed[6], x), fixed[:3], fixed[3:6], 0.5 * h
        bent = (par.I3 - par.I1) * along
        side = plus(scaled(i, across), -bent, cross(across, e))
        m, v = cayley(plus(scaled(along, e), n / (i * i + bent * bent), side))
        kick = scaled(half, gravity(par, e))
        return m, v, plus(kick, half, gravity(par, plus(e, 1.0, moved(m, v, e)))), carry

    return iterated_loop((start, iterate, close), MOST_SWEEPS, opened=8, unknowns=unknowns)


MARCH = {MOSER_VESELOV: _loop(*RIGID_BODY, 1), EULER_POINCARE: _loop(*RETRACTION, 3)}


@register_jitable
def _image(par: Any, kind: float, a: Any, u: Any, Ju: Any, d: Any) -> Any:
    """The derivative along d of J u + u x J u + kind (u.J u) u - (1 - kind) u^2 a, J in the axes of the body."""
    Jd = par.I1 * d[0], par.I2 * d[1], par.I3 * d[2]
    image = plus(plus(Jd, 1.0, cross(d, Ju)), 1.0, cross(u, Jd))
    image = plus(plus(image, kind * dot(u, Ju), d), 2.0 * kind * dot(u, Jd), u)
    return plus(image, -2.0 * (1.0 - kind) * dot(u, d), a)


def _start(par: Any, rule: Any, g: Any, M: Any, carry: Any, h: float) -> Any:
    """Gamma and M after half of the kick, and the first u."""
    half = 0.5 * h
    momentum = plus(M, half, torque(par, *g))
    a = scaled(half, momentum)
    return (*g, *momentum), (par.a1 * a[0], par.a2 * a[1], par.a3 * a[2])


def _iterate(par: Any, rule: Any, carry: Any, h: float, fixed: Any, u: Any) -> Any:
    """Newton's next u, in the axes of the body."""
    kind, a = rule[0], scaled(0.5 * h, fixed[3:])
    Ju = par.I1 * u[0], par.I2 * u[1], par.I3 * u[2]
    residual = plus(scaled(1.0 + (1.0 - kind) * dot(u, u), a), -1.0, Ju)
    residual = plus(plus(residual, -1.0, cross(u, Ju)), -kind * dot(u, Ju), u)
    first = _image(par, kind, a, u, Ju, (1.0, 0.0, 0.0))
    second = _image(par, kind, a, u, Ju, (0.0, 1.0, 0.0))
    third = _image(par, kind, a, u, Ju, (0.0, 0.0, 1.0))
    change = solve3(first, second, third, residual)
    u = plus(u, 1.0, change)
    converged = dot(change, change) <= CONVERGED_CORRECTION * CONVERGED_CORRECTION * dot(u, u)
    return u, converged, not dot(first, cross(second, third)) > 0.0


def _close(par: Any, rule: Any, carry: Any, h: float, fixed: Any, u: Any) -> Any:
    """The rotation, and the change of M with both halves of the kick."""
    g, momentum = fixed[:3], fixed[3:]
    m, v = cayley(scaled(-1.0, u))  # space turns the other way
    kick = plus(torque(par, *g), 1.0, torque(par, *plus(g, 1.0, moved(m, v, g))))
    return m, v, plus(moved(m, v, momentum), 0.5 * h, kick), carry


march_body = iterated_loop(
    (_start, _iterate, _close), MOST_SWEEPS, opened=6, unknowns=3, numbers=lambda rule: (rule.kind,), carried=TURNED,
    observe=observe_turned,
)  # fmt: skip


def lie_variational(name: str, rule: Variational, order: int, summary: str, reference: str) -> Integrator:
    """The variational integrator of a discrete Lagrangian and a composition."""
    return Integrator(
        name=name, family="discrete-lagrangian", summary=summary, reference=reference, order=order, explicit=False,
        symplectic=True, symmetric=True, conserves=frozenset({"p_phi", "p_psi", "axis_length"}),
        solvers=in_charts(MARCH[rule.kind], rule, SPUN, 1, implicit=True, of_body=march_body),
        needs="kicks", general=True,
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
