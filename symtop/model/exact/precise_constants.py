"""The constants of the closed form from 40 digits: the second witness, and the last resort of `closed_form`.

The same theta functions as in `symtop.model.exact.half_angles`, built in the arithmetic of a `PreciseForm` and rounded
once. Cost: 15 milliseconds.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.model.charts import Array
from symtop.model.exact import motion_layout as at
from symtop.model.exact.precise_form import PreciseForm
from symtop.model.top import Angles, SymmetricTop

DIGITS = 40

# sin((2n+1)x)/sin x, cos((2n+1)x)/cos x, cos 2nx and sin 2nx/(sin x cos x) in powers of cos 2x
_SINES = ((1, 0, 0, 0), (1, 2, 0, 0), (-1, 2, 4, 0), (-1, -4, 4, 8))
_COSINES = ((1, 0, 0, 0), (-1, 2, 0, 0), (-1, -2, 4, 0), (1, -4, -4, 8))
_EVEN_COSINES = ((1, 0, 0, 0), (0, 1, 0, 0), (-1, 0, 2, 0), (0, -3, 0, 4))
_EVEN_SINES = ((0, 0, 0, 0), (2, 0, 0, 0), (0, 4, 0, 0), (-2, 0, 8, 0))


def precise_constants(top: SymmetricTop, start: Angles, form: PreciseForm | None = None) -> Array:
    """The array of constants, from a form that there is or from one of `DIGITS` digits.

    Raises `SymtopError` if the axis comes within 1e-145 of a pole that it does not meet.
    """
    form, out = form or PreciseForm(top, start, digits=DIGITS), np.zeros(at.SIZE)
    ctx, curve = form.ctx, form.curve
    out[at.ARITHMETIC], out[at.UPRIGHT], out[at.I1] = at.DIGITS, form.facing > 0, top.I1
    out[at.P_PSI], out[at.W3] = float(form.p_psi), float(form.p_psi / form.I3)
    out[at.ENERGY], out[at.P_PHI] = float(form.energy), float(form.p_phi)
    out[at.PERIOD] = float(form.nutation_period)
    out[at.PHI_PER_PERIOD], out[at.PSI_PER_PERIOD] = float(form.phi_per_period), float(form.psi_per_period)
    out[at.THETA_LOW], out[at.THETA_HIGH] = float(form.theta_range[0]), float(form.theta_range[1])
    if form.climbs:
        out[at.KIND], out[at.SCALE], out[at.FLOOR_SIGN] = at.CLIMBS, float(form.Omega), float(form.floor_sign)
    elif curve.swing:
        if any(0 < gap < 1e-290 for gap in (curve.floor.low, curve.crown.high, curve.m1)):
            raise SymtopError(
                f"the axis must meet a pole or miss it by 1e-145 (PreciseForm takes less), not as {start!r}"
            )
        _expand(form, out)
    else:
        rest = (ctx.sqrt(curve.floor.low / 2), ctx.sqrt(curve.crown.low / 2), form.phi_rate)
        out[[at.REST_DOWN, at.REST_UP, at.REST_RATE]] = [float(value) for value in rest]

    leading = [(angle - lag) / 2 for angle, lag in zip(form.angles0, form.lags0, strict=True)]
    phi0, psi0 = sum(leading), form.facing * (leading[0] - leading[1])
    turn = 2 * ctx.pi
    _put_line(out, at.PHI_LINE, form.phi_rate, phi0)
    _put_line(out, at.PSI_LINE, form.psi_rate, psi0)
    halves = ((rate / 2, start) for rate, start in zip(form.mean_rates, leading, strict=True))
    for place, (rate, begun) in zip(
        (at.PHI_TURNS, at.DOWN_TURNS, at.UP_TURNS), ((form.phi_rate, phi0), *halves), strict=True
    ):
        _put_line(out, place, rate / turn, begun / turn - ctx.nint(begun / turn))
    return out


def _expand(form: PreciseForm, out: Array) -> None:
    """Coefficients about the turning points u1 (near the floor) and u2 (near the crown), scaled to moduli of 1."""
    ctx, curve, hyperbolic = form.ctx, form.curve, bool(form.m > 0.5)
    signs = [float(ctx.sign(pole.twist)) for pole in curve[:2]]
    out[at.KIND], out[at.HYPERBOLIC], out[at.FLOOR_SIGN] = at.MOVES, hyperbolic, float(form.floor_sign)
    out[at.SIGN_DOWN], out[at.SIGN_UP], out[at.MAY_STOP] = *signs, signs[0] * signs[1] < 0.0
    out[at.TWIST_DOWN], out[at.TWIST_UP] = (float(ctx.sqrt(abs(pole.twist)) / 2) for pole in curve[:2])
    _put_line(out, at.QUARTERS, form.Omega / form.K, form.tau0 / form.K)
    period, other = (form.K1, form.K) if hyperbolic else (form.K, form.K1)
    nome = ctx.exp(-ctx.pi * other / period) if form.m else ctx.zero
    heights = [ctx.pi * height / (2 * period) for height in form.zero_heights()]
    halves = [(_hyperbolic_halves if hyperbolic else _trigonometric_halves)(ctx, y, nome) for y in heights]
    growths = [float(ctx.pi / 2 - (y if hyperbolic else 0)) for y in heights]
    scale, bend = ctx.pi * form.K / (2 * period), _series(_SINES, _weights(ctx, nome))
    out[at.SCALE] = float(scale)
    _put(out, at.BEND, bend, 1)
    floor, crown = curve.floor, curve.crown
    for near, frame, side, least, most, grows in (
        (0, at.FLOOR, 1, floor.low, crown.low, 1),
        (1, at.CROWN, -1, crown.high, floor.high, form.m1),
    ):
        near_real, near_imag, _, _ = halves[near]
        _, _, far_real, far_imag = halves[1 - near]
        depth = curve.swing * grows * (form.K / scale) ** 2  # abs(u - u_near) = depth angle^2
        near_unit = ctx.sqrt(least / 2) / sum(near_real) if least else ctx.sqrt(depth / 2) / sum(near_imag)
        far_unit = ctx.sqrt(most / 2) / sum(far_real)
        _put(out, frame + at.NEAR_REAL, near_real, near_unit)
        _put(out, frame + at.NEAR_IMAG, near_imag, near_unit)
        _put(out, frame + at.FAR_REAL, far_real, far_unit)
        _put(out, frame + at.FAR_IMAG, far_imag, far_unit)
        out[frame + at.NEAR_GROWTH], out[frame + at.FAR_GROWTH] = growths[near], growths[1 - near]
        out[frame + at.STEEPNESS] = float(-side * form.Omega * depth * scale / form.K / sum(bend))
        out[frame + at.LEAN] = float((floor.twist * crown[1 + near] + crown.twist * floor[1 + near]) / 2)  # b - a u
        out[frame + at.LEANING] = float(-side * form.facing * form.a * depth / sum(bend) ** 2)
        out[frame + at.THROUGH] = least == 0


def _trigonometric_halves(ctx: Any, y: Any, nome: Any) -> tuple[list[Any], ...]:
    """i theta_1(z - i y), then theta_2(z - i y): factors of cos z and i sin z, as polynomials in cos 2z."""
    cosh = [w * ctx.cosh((2 * n + 1) * y) for n, w in enumerate(_weights(ctx, nome))]
    sinh = [w * ctx.sinh((2 * n + 1) * y) for n, w in enumerate(_weights(ctx, nome))]
    near = _series(_COSINES, sinh), _series(_SINES, cosh)
    return *near, _series(_COSINES, map(abs, cosh)), _series(_SINES, map(abs, sinh))


def _hyperbolic_halves(ctx: Any, y: Any, nome: Any) -> tuple[list[Any], ...]:
    """theta_1(y + i s), factors of cosh s and i sinh s, then theta_4(y + i s), of 1 and i sinh s cosh s; in cosh 2s."""
    odd = _weights(ctx, nome)
    even = [2 * (-1) ** n * nome ** (n * n) if n else ctx.one for n in range(4)]
    return (
        _series(_COSINES, (w * ctx.sin((2 * n + 1) * y) for n, w in enumerate(odd))),
        _series(_SINES, (w * ctx.cos((2 * n + 1) * y) for n, w in enumerate(odd))),
        _series(_EVEN_COSINES, (w * ctx.cos(2 * n * y) for n, w in enumerate(even))),
        _series(_EVEN_SINES, (-w * ctx.sin(2 * n * y) for n, w in enumerate(even))),
    )


def _weights(ctx: Any, nome: Any) -> list[Any]:  # of theta_1 without its factor 2 q^(1/4)
    return [(-1) ** n * nome ** (n * (n + 1)) if n else ctx.one for n in range(4)]


def _series(basis: tuple[tuple[int, ...], ...], weights: Iterable[Any]) -> list[Any]:
    weighted = ([weight * power for power in powers] for weight, powers in zip(weights, basis, strict=True))
    return [sum(column) for column in zip(*weighted, strict=True)]


def _put(out: Array, place: int, values: list[Any], unit: Any) -> None:
    out[place : place + 4] = [float(unit * value) for value in values]


def _put_line(out: Array, place: int, rate: Any, start: Any) -> None:
    """A rate and a start, each as the two doubles nearest to it."""
    for i, value in enumerate((rate, start)):
        out[place + 2 * i] = float(value)
        out[place + 2 * i + 1] = float(value - float(value))
