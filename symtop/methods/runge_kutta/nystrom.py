"""An embedded Runge-Kutta-Nystrom pair on the reduced angles: `dprkn8`, order 8(6), with SciPy's control of the step.

In angles H = p_theta^2/2 I1 + V(theta) + const, so that theta'' = F(theta) = -V'(theta)/I1 knows no velocity, and phi'
and psi' are functions of theta alone:

    theta_i = theta + c_i h theta' + h^2 sum_{j<i} a_ij F_j,    k_i = (-V', phi', psi') at theta_i
    theta+ = theta + h theta' + h^2 sum_i b_i F_i,    (p_theta, phi, psi)+ = (p_theta, phi, psi) + h sum_i b'_i k_i

Positions alone have far fewer order conditions than positions and velocities: order 8 takes eight forces, where
`dop853` takes twelve. The ninth stage is the first one of the next step. The error estimate is of order q = 6. A sample
inside a step is a shorter step, not counted. Neither symplectic nor symmetric; p_phi and p_psi, read off the increments
of phi and psi, are those of the start. It ends at theta = 0 and pi. Not to be confused with `srkn`, splittings,
symplectic and without an error estimate. Source: Dormand, El-Mikkawy, Prince, IMA J. Numer. Anal. 7 (1987) 423, the
pair RKN8(6)9FM.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.core.sines import sincos
from symtop.methods.framework.angles import LEAST_TOLERANCE, chart_outcome, momenta_of_turns, on_angles
from symtop.methods.framework.equations import FORMS
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.explicit import row_of, store, written_out
from symtop.methods.runge_kutta.pair_tables import Row
from symtop.methods.runge_kutta.pairs import Method, combination, rms, solver, trying
from symtop.methods.splitting.angles import force_angles


class Table(NamedTuple):
    """An explicit Nystrom pair: nodes, rows of the matrix from the second on, weights, and the weights of the error."""

    c: Row
    a: tuple[Row, ...]
    b: Row  # of theta
    velocity: Row  # b' of p_theta, phi and psi
    error: Row
    velocity_error: Row


# fmt: off
DPRKN8 = Table(
    c=(1 / 20, 1 / 10, 3 / 10, 1 / 2, 7 / 10, 9 / 10, 1.0, 1.0),
    a=(
        (1 / 800,),
        (1 / 600, 1 / 300),
        (9 / 200, -9 / 100, 9 / 100),
        (-66701 / 197352, 28325 / 32892, -2665 / 5482, 2170 / 24669),
        (227015747 / 304251000, -54897451 / 30425100, 12942349 / 10141700, -9499 / 304251, 539 / 9250),
        (-1131891597 / 901789000, 41964921 / 12882700, -6663147 / 3220675, 270954 / 644135, -108 / 5875, 114 / 1645),
        (13836959 / 3667458, -17731450 / 1833729, 1063919505 / 156478208, -33213845 / 39119552, 13335 / 28544,
         -705 / 14272, 1645 / 57088),
        (223 / 7938, 0.0, 1175 / 8064, 925 / 6048, 41 / 448, 925 / 14112, 1175 / 72576),
    ),
    b=(223 / 7938, 0.0, 1175 / 8064, 925 / 6048, 41 / 448, 925 / 14112, 1175 / 72576),
    velocity=(223 / 7938, 0.0, 5875 / 36288, 4625 / 21168, 41 / 224, 4625 / 21168, 5875 / 36288, 223 / 7938),
    error=(223 / 7938 - 7987313 / 109941300, 0.0, 1175 / 8064 - 1610737 / 44674560, 925 / 6048 - 10023263 / 33505920,
           41 / 448 + 497221 / 12409600, 925 / 14112 - 10023263 / 78180480, 1175 / 72576 - 1610737 / 402071040),
    velocity_error=(
        223 / 7938 - 7987313 / 109941300, 0.0, 5875 / 36288 - 1610737 / 40207104, 4625 / 21168 - 10023263 / 23454144,
        41 / 224 + 497221 / 6204800, 4625 / 21168 - 10023263 / 23454144, 5875 / 36288 - 1610737 / 40207104,
        223 / 7938 + 4251941 / 54970650, -3 / 20,
    ),
)
# fmt: on


@register_jitable
def kicks(par: Any, theta: Any) -> Any:
    """(-V', phi', psi'), and theta itself."""
    slope, precession, turn = force_angles(par, (theta,), (0.0,))
    return -slope, precession, par.p_psi / par.I3 - turn, theta


def _total(weights: Row, velocity: Row) -> Any:
    """A function (par, ks, h): the increments of (theta, p_theta, phi, psi) due to the forces."""
    bend, turn = combination(weights), combination(velocity)

    def increments(par, ks, h):  # type: ignore[no-untyped-def]
        return bend((0.0,), ks, h * h / par.I1) + turn((0.0, 0.0, 0.0), ks, h)

    return register_jitable(increments)


@register_jitable
def _field(par: Any, state: Any) -> Any:
    slope, precession, turn, _ = kicks(par, state[0])
    return state[1] / par.I1, slope, precession, turn


REDUCED = FORMS["angles"]._replace(
    field=_field, ended=register_jitable(lambda state: chart_outcome(state[0])), prepare=on_angles, present=None,
    observe=lambda _par, memory, _place, _nothing, _h: (memory[2, 0], memory[2, 1]),
)  # fmt: skip


def method(_: Callable[..., Any]) -> Method:
    """The pair as `pairs.loop` takes it; rows of the memory: f at both ends of the step, and p_phi, p_psi."""
    table, velocity = DPRKN8, DPRKN8.velocity

    def stage(i: int) -> Callable[..., Any]:
        bend, node = combination(table.a[i - 1]), table.c[i - 1]

        def k(par, state, ks, slopes, h):  # type: ignore[no-untyped-def]
            theta = state[0] + node * h * state[1] / par.I1
            return kicks(par, bend((theta,), ks, h * h / par.I1)[0])

        return k

    stages, cost, count = written_out(len(table.a) + 1, stage), len(table.a), len(velocity)
    total, error = _total(table.b, velocity), _total(table.error, table.velocity_error)

    @register_jitable
    def stage_slopes(par, state, slopes, h):  # type: ignore[no-untyped-def]
        first = row_of(slopes, 0, state)
        return stages(par, state, (first[1], first[2], first[3], state[0]), slopes, h)

    @register_jitable
    def after(par, state, ks, h):  # type: ignore[no-untyped-def]
        step = total(par, ks, h)
        dtheta = h * state[1] / par.I1 + step[0]
        return state[0] + dtheta, state[1] + step[1], state[2] + step[2], state[3] + step[3]

    @register_jitable
    def attempt(par, state, slopes, h, tolerance):  # type: ignore[no-untyped-def]
        ks = stage_slopes(par, state, slopes, h)
        new, last = after(par, state, ks, h), ks[-1]
        store(slopes, 1, (new[1] / par.I1, last[0], last[1], last[2]))
        return new, rms(error(par, ks, h), state, new, tolerance)

    @register_jitable
    def momenta(par, state, slopes, h):  # type: ignore[no-untyped-def]
        ks = stage_slopes(par, state, slopes, h)
        step, a, d = total(par, ks, h), 0.0, 0.0
        for i in range(count):
            sin_x, cos_x = sincos(0.5 * ks[i][3])
            a += h * velocity[i] / (4.0 * par.I1 * sin_x * sin_x)
            d += h * velocity[i] / (4.0 * par.I1 * cos_x * cos_x)
        slopes[2, 0], slopes[2, 1] = momenta_of_turns(par, a, d, h, step)
        return 0

    @register_jitable
    def shorter(par, state, new, slopes, h, x):  # type: ignore[no-untyped-def]
        return after(par, state, stage_slopes(par, state, slopes, x * h), x * h)

    return Method(trying(attempt, cost, -1.0 / 7.0), momenta, shorter, 1, -1.0 / 7.0)


def built_in() -> list[Integrator]:
    """`dprkn8`."""
    return [
        Integrator(
            name="dprkn8", family="runge-kutta", control="tolerance", order=8,
            solvers={"angles": solver(REDUCED, method, 3)},
            summary="Runge-Kutta-Nystrom pair 8(6) of Dormand, El-Mikkawy and Prince on the reduced angles, compiled",
            explicit=True, symplectic=False, symmetric=False, conserves=frozenset({"p_phi", "p_psi"}),
            least_tolerance=LEAST_TOLERANCE, reference="dormand-el-mikkawy-prince-1987", needs="kicks", general=False,
        )
    ]  # fmt: skip
