"""Fourth-order Galerkin variational integrator: a parabola through three angles, Simpson's rule.

With q(t) the parabola through q0, qm, q1 at t = 0, h/2, h, whose rates at the nodes are

    q0' = (-3 q0 + 4 qm - q1)/h,    qm' = (q1 - q0)/h,    q1' = (q0 - 4 qm + 3 q1)/h,

L_d(q0, q1) = ext over qm of h (L0 + 4 Lm + L1)/6. Let P_i, F_i be dL/dq' and dL/dq at the nodes. Stationarity in qm is
P1 - P0 = h Fm, and the discrete Legendre transform p0 = (3 P0 + 4 Pm - P1)/6 - h F0/6 and so on. Hence

    theta1 - theta0 = h p0/I1 - h^2 (V0 + 2 Vm)/(6 I1),    thetam - theta0 = (theta1 - theta0)/2 + h^2 Vm/(8 I1)
    p_theta1 = p_theta0 - h (V0 + 4 Vm + V1)/6

where V_i = -F_i = V'(theta_i; P_i) is the slope of the effective potential at the node's own momenta of phi and psi.
These do not change in time (F = 0): P0 = P1 = p + e, Pm = p - e/2, and qm' = (q0' + q1')/2 fixes e. In the coordinates
(phi + psi, phi - psi) and (south, north) the inverse inertia of the top is, with x = theta/2,

    B = [[k + 2 d, -k], [-k, k + 2 a]],   k = (1/I3 - 1/I1)/2,   d = 1/(4 I1 cos^2 x),   a = 1/(4 I1 sin^2 x)
    (B0 + Bm + B1) e = 2 ((2 dm - d0 - d1) south, (2 am - a0 - a1) north)

a 2 x 2 system without cancellation at the poles, and dphi = h phi'(thetam; Pm), dpsi = h psi'(thetam; Pm). What remains
is Newton on (thetam, theta1). Its Jacobian is analytic: with g_i = dV_i/d(south, north), which is
(d_i south_i tan x_i, -a_i north_i cot x_i),

    (B0 + Bm + B1) de/dthetam = 4 g_m,      (B0 + Bm + B1) de/dtheta1 = -2 g_1.

Order 4, symmetric, symplectic, p_phi and p_psi conserved exactly. It is not `simpson-linear`, whose path is a straight
line and whose order is 2, and only for a constant mass is it Lobatto IIIA-IIIB of order 4: that pair makes the momenta
linear in time, this method the rates. On the top, whose inertia depends on theta, the two differ by O(h^4), and Lobatto
IIIA-IIIB is what comes of reducing first. Source: Marsden and West, Discrete mechanics and variational integrators,
Acta Numerica 10 (2001) 357, on Galerkin methods.
"""

from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.core.sines import sincos
from symtop.methods.framework.angles import ReducedTop, chart_outcome, on_angles
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.newton import ANGLE_GRAIN, NEGLIGIBLE_ANGLE, Correction, newton_loop
from symtop.methods.framework.registry import Integrator


class Iteration(NamedTuple):
    """When Newton stops, as in `discrete_lagrangian.Quadrature`."""

    tolerance: float = 1e-8
    iterations: int = 50


class _Node(NamedTuple):
    d: float  # 1 / (4 I1 cos^2 x)
    a: float  # 1 / (4 I1 sin^2 x)
    tangent: float  # tan x
    sine: float  # of theta
    cosine: float


class _Pull(NamedTuple):
    slope: float  # V' at a node
    stiffness: float  # V''
    south: float  # dV'/dsouth
    north: float  # dV'/dnorth


@register_jitable
def node_at(par: Any, theta: float) -> Any:
    """The trigonometry of a node."""
    sin_x, cos_x = sincos(0.5 * theta)
    low, high = sin_x * sin_x, cos_x * cos_x
    return _Node(0.25 / (par.I1 * high), 0.25 / (par.I1 * low), sin_x / cos_x, 2.0 * sin_x * cos_x, high - low)


@register_jitable
def pull_at(par: Any, node: Any, south: float, north: float) -> Any:
    """V' of `_Node`, and what Newton needs of it: phi' = D + A, V' = sin(theta) [I1 (D^2 - A^2) - mgl]."""
    D, A = node.d * south, node.a * north
    bracket = par.I1 * (D - A) * (D + A) - par.mgl
    by_south, by_north = D * node.tangent, -A / node.tangent
    bend = 2.0 * par.I1 * node.sine * (D * by_south - A * by_north)
    return _Pull(node.sine * bracket, node.cosine * bracket + bend, by_south, by_north)


class _Jet(NamedTuple):
    """A number and its derivatives with respect to the two unknowns, thetam and theta1."""

    value: float
    by_m: float
    by_1: float


class _Trial(NamedTuple):
    V0: _Jet
    Vm: _Jet
    V1: _Jet
    plus: _Jet  # d(phi + psi)/h
    minus: _Jet  # d(phi - psi)/h


@register_jitable
def _extrapolate(jet: Any, change: Any) -> Any:
    """The number after a correction of the unknowns, to first order."""
    return jet.value + jet.by_m * change[0] + jet.by_1 * change[1]


@register_jitable
def _evaluate(par: Any, start: Any, theta_m: float, theta_1: float) -> Any:
    """Slopes, rates and derivatives at trial angles, from the trigonometry at the start."""
    middle, end = node_at(par, theta_m), node_at(par, theta_1)
    k = 0.5 * (1.0 / par.I3 - 1.0 / par.I1)
    # B0 + Bm + B1 is symmetric and positive definite: its inverse [[N, K], [K, S]] is applied three times
    S, N = 3.0 * k + 2.0 * (start.d + middle.d + end.d), 3.0 * k + 2.0 * (start.a + middle.a + end.a)
    inverse = 1.0 / (S * N - 9.0 * k * k)
    S, N, K = S * inverse, N * inverse, 3.0 * k * inverse
    load_s = 2.0 * ((middle.d - start.d) + (middle.d - end.d)) * par.south
    load_n = 2.0 * ((middle.a - start.a) + (middle.a - end.a)) * par.north
    e_s, e_n = N * load_s + K * load_n, K * load_s + S * load_n
    south, north = par.south - 0.5 * e_s, par.north - 0.5 * e_n
    first = pull_at(par, start, par.south + e_s, par.north + e_n)
    inner = pull_at(par, middle, south, north)
    last = pull_at(par, end, par.south + e_s, par.north + e_n)
    es_m, en_m = 4.0 * (N * inner.south + K * inner.north), 4.0 * (K * inner.south + S * inner.north)
    es_1, en_1 = -2.0 * (N * last.south + K * last.north), -2.0 * (K * last.south + S * last.north)
    b_s, b_n = k + 2.0 * middle.d, k + 2.0 * middle.a
    return _Trial(
        _Jet(first.slope, first.south * es_m + first.north * en_m, first.south * es_1 + first.north * en_1),
        _Jet(
            inner.slope,
            inner.stiffness - 0.5 * (inner.south * es_m + inner.north * en_m),
            -0.5 * (inner.south * es_1 + inner.north * en_1),
        ),
        _Jet(last.slope, last.south * es_m + last.north * en_m, last.stiffness + last.south * es_1 + last.north * en_1),
        _Jet(
            b_s * south - k * north, 2.0 * inner.south - 0.5 * (b_s * es_m - k * en_m), -0.5 * (b_s * es_1 - k * en_1)
        ),
        _Jet(
            b_n * north - k * south, 2.0 * inner.north - 0.5 * (b_n * en_m - k * es_m), -0.5 * (b_n * en_1 - k * es_1)
        ),
    )


class _Step(NamedTuple):
    par: Any
    rule: Any
    theta: float
    start: _Node
    h: float
    flight: float  # h p / I1, d without any force
    scale: float  # h^2 / I1


def _equations(par: Any, rule: Any, state: Any, steady: Any, opened: Any) -> Any:
    h, scale = steady
    return _Step(par, rule, state[0], _Node(*opened), h, h * state[1] / par.I1, scale)


def _trial_at(step: Any, unknowns: Any) -> Any:
    """The trial at m = thetam - theta0 and d = theta1 - theta0."""
    m, d = unknowns
    return _evaluate(step.par, step.start, step.theta + m, step.theta + d)


def _correct(step: Any, trial: Any, unknowns: Any) -> Any:
    """Newton's correction of (m, d) for flight - d - scale (V0 + 2 Vm)/6 = 0 and d/2 - m + scale Vm/8 = 0."""
    m, d = unknowns
    V0, Vm, scale = trial.V0, trial.Vm, step.scale
    gap = step.flight - d - scale * (V0.value + 2.0 * Vm.value) / 6.0
    bow = 0.5 * d - m + scale * Vm.value / 8.0
    gap_m, gap_d = scale * (V0.by_m + 2.0 * Vm.by_m) / 6.0, 1.0 + scale * (V0.by_1 + 2.0 * Vm.by_1) / 6.0
    bow_m, bow_d = 1.0 - scale * Vm.by_m / 8.0, -0.5 - scale * Vm.by_1 / 8.0
    inverse = 1.0 / (gap_d * bow_m - gap_m * bow_d)
    dm, dd = (bow * gap_d - gap * bow_d) * inverse, (gap * bow_m - bow * gap_m) * inverse
    reach = abs(step.flight) + scale * (abs(V0.value) + abs(Vm.value))
    enough = step.rule.tolerance * reach + NEGLIGIBLE_ANGLE
    return Correction((dm, dd), (m + dm, d + dd), abs(dm) + abs(dd), enough, ANGLE_GRAIN)


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """V' at the start, as a history of V0 and Vm for the predictor."""
    V = pull_at(par, node_at(par, state[0]), par.south, par.north).slope
    return (V, V, V, V, V, V, V, V)


def _predict(step: Any, carry: Any) -> Any:
    """thetam - theta0 and theta1 - theta0, from the cubic through the last four values of V0 and of Vm."""
    V0 = 4.0 * (carry[0] + carry[4]) - 6.0 * carry[2] - carry[6]
    Vm = 4.0 * (carry[1] + carry[5]) - 6.0 * carry[3] - carry[7]
    d = step.flight - step.scale * (V0 + 2.0 * Vm) / 6.0
    return 0.5 * d + step.scale * Vm / 8.0, d


def _keep(trial: Any, correction: Any) -> Any:
    """The last trial with the last correction added to first order; the remainder is its square."""
    change = correction.change
    return (
        _extrapolate(trial.V0, change), _extrapolate(trial.Vm, change), _extrapolate(trial.V1, change),
        _extrapolate(trial.plus, change), _extrapolate(trial.minus, change), correction.after[1],
    )  # fmt: skip


def _close(step: Any, end: Any) -> Any:
    V0, Vm, V1, plus, minus, d = end
    h = step.h
    dstate = (d, -h * (V0 + 4.0 * Vm + V1) / 6.0, 0.5 * h * (plus + minus), 0.5 * h * (plus - minus))
    return dstate, (V0, Vm), chart_outcome(step.theta + d)


@register_jitable
def _momenta(par: Any, node: Any, plus: float, minus: float) -> Any:
    """South and north of given rates of phi + psi and phi - psi at a node: the inverse of B."""
    k = 0.5 * (1.0 / par.I3 - 1.0 / par.I1)
    inverse = 1.0 / (2.0 * k * (node.a + node.d) + 4.0 * node.a * node.d)
    return (((k + 2.0 * node.a) * plus + k * minus) * inverse, (k * plus + (k + 2.0 * node.d) * minus) * inverse)


def observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi by the discrete Legendre transform of the increments that were added.

    The rates at the middle give P0 = 2 (B0 + B1)^-1 q'; P0 gives V0, and p_theta0 = I1 (16 m - 2 d)/6h + h V0/6 gives
    thetam = theta0 + m; then Pm = Bm^-1 q' and p = (P0 + 2 Pm)/3.
    """
    theta, d = before[0], dstate[0]
    start, end = node_at(par, theta), node_at(par, theta + d)
    plus, minus = (dstate[2] + dstate[3]) / h, (dstate[2] - dstate[3]) / h
    mean = _Node(0.5 * (start.d + end.d), 0.5 * (start.a + end.a), 0.0, 0.0, 0.0)
    south, north = _momenta(par, mean, plus, minus)
    V0 = pull_at(par, start, south, north).slope
    m = (6.0 * h / par.I1 * (before[1] - h * V0 / 6.0) + 2.0 * d) / 16.0
    south_m, north_m = _momenta(par, node_at(par, theta + m), plus, minus)
    south, north = (south + 2.0 * south_m) / 3.0, (north + 2.0 * north_m) / 3.0
    return 0.5 * (south + north), 0.5 * (south - north)


march = newton_loop(
    begin, observe, constants=lambda par, h: (h, h * h / par.I1), start=lambda par, _rule, theta: node_at(par, theta),
    equation=_equations, predict=_predict, evaluate=_trial_at, correct=_correct, keep=_keep, close=_close,
    restart=lambda step: (0.5 * step.flight, step.flight), top=ReducedTop, dimension=4, steady=2, opened=5,
    unknowns=2, ends=6, newest=2, carry=8,
)  # fmt: skip


def built_in() -> list[Integrator]:
    """The Galerkin integrator that ships with symtop."""
    return [
        Integrator(
            name="galerkin-simpson", family="discrete-lagrangian",
            summary="Galerkin discrete Lagrangian, parabola in time and Simpson's rule",
            solvers={"angles": FixedStep(march, Iteration(), on_angles, 2, implicit=True, each_step=1)},
            order=4, explicit=False, symplectic=True, symmetric=True,
            conserves=frozenset({"p_phi", "p_psi"}),
            reference="marsden-west-2001", needs="lagrangian", general=True,
        )
    ]  # fmt: skip
