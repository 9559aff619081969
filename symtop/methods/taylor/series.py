"""Taylor series of the space-frame equations in forms made for them: `axis_series` and `attitude_series`.

    series            one order and a fixed step
    series-adaptive   order and steps of a tolerance (`series_steps`)

On the axis a step of order 16 takes the time of two steps of `strang`, on the attitude that of three. Explicit, no
poles; not symplectic, which shows where the truncation lies above rounding: the energy then drifts.
Source: Biscani, Izzo, Mon. Not. R. Astron. Soc. 504 (2021) 2614; the recurrences are derived here.
"""

from symtop.core.errors import SymtopError, whole
from symtop.core.numbers import EPSILON
from symtop.methods.framework.fixed_step import FixedStep
from symtop.methods.framework.preparation import Scaled
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import on_attitude, on_axis
from symtop.methods.taylor import attitude_series, axis_series
from symtop.methods.taylor.axis_series import Scale, scale
from symtop.methods.taylor.series_steps import CHARTS, ORDERS, solver

DEFAULT_ORDER = 16


def series(name: str, order: int = DEFAULT_ORDER) -> Integrator:
    """The series of an order, 8, 12, 16 or 20, with a fixed step. Raises SymtopError for another order."""
    order = whole("order", order, ORDERS[0])
    if order not in ORDERS:
        raise SymtopError(f"order must be one of {', '.join(map(str, ORDERS))}, not {order!r}")
    rule = Scaled(Scale(), scale)
    return Integrator(
        name=name,
        family="taylor",
        summary=f"Taylor series on the space-frame equations, order {order}, by products of vectors",
        solvers={
            "axis": FixedStep(axis_series.march_axis(order), rule, on_axis, order, implicit=False),
            "attitude": FixedStep(attitude_series.march_attitude(order), rule, on_attitude, order, implicit=False),
        },
        order=order, explicit=True, symplectic=False, symmetric=False, conserves=frozenset({"p_phi"}),
        reference="biscani-izzo-2021",
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """`series` and `series-adaptive`."""
    adaptive = Integrator(
        name="series-adaptive",
        family="taylor",
        summary="Taylor series on the space-frame equations with order and steps of a tolerance, compiled",
        solvers={chart: solver(chart) for chart in CHARTS},
        control="tolerance", explicit=True, symplectic=False, symmetric=False, conserves=frozenset({"p_phi"}),
        least_tolerance=EPSILON / 1000.0,
        default_tolerance=EPSILON / 10.0,
        reference="biscani-izzo-2021",
    )  # fmt: skip
    return [series("series"), adaptive]
