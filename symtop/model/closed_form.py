"""Closed-form motion of the heavy symmetric top in double precision, vectorised over time.

The attitude is written in the two complex half-angle functions of Klein and Sommerfeld,

    A = cos(theta/2) exp(i (phi + psi)/2),        B = sin(theta/2) exp(i (phi - psi)/2),

which are quotients theta_k(z - i y)/theta_4(z), z = pi tau/2K, times an exponential (constants:
`symtop.model.precise_form`).
theta_4 is common to both and cancels in every angle. About each turning point, at x quarter periods from it, one
function belongs to the pole that the axis is near and one to the pole that it is far from; up to a common real factor,
with polynomials P of degree 3 in C,

    m <= 1/2    near, far = cos z P + i sin z P,                       z = pi x/2,      C = cos 2z,   nome exp(-pi K'/K)
    m >  1/2    near = cosh s P + i sinh s P, far = P + i sinh 2s P,   s = pi K x/2K',  C = cosh 2s,  nome exp(-pi K/K')

The second line is Jacobi's imaginary transformation. The nome is at most exp(-pi) = 0.043 either way: the first dropped
term is below 1e-19, m -> 1 is no special case, and m = 0 is trigonometry. As abs(x) <= 1/2, everything is relatively
accurate at both turning points, however closely the axis grazes a pole there. Then

    theta = 2 atan2(abs B, abs A),        (phi +- psi)/2 = mean rate t + (argument - its mean growth) + const,
    theta' sin theta = const theta_1(2z)/theta_4(z)^4,        u - u1, u2 - u = const theta_k(z)^2/theta_4(z)^2.

The phase and the secular angles are products of t with rates of two doubles, so that the error of theta does not grow
with time, and that of phi and psi only as their last digit does. Cost: 0.2 microseconds a time; no special functions.
Not to be confused with the small-nutation approximation: nothing is expanded in the amplitude. Sources: Klein and
Sommerfeld, Theory of the Top, chapter 6; Whittaker and Watson, A Course of Modern Analysis, chapter 21.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symtop.base.validate import SymtopError
from symtop.model.charts import Array
from symtop.model.double_double import Pair, line, on_line, pair, reduced, turns
from symtop.model.precise_form import Motion, PreciseForm
from symtop.model.top import Angles, SymmetricTop

Cubic = tuple[float, float, float, float]

# sin((2n+1)x)/sin x, cos((2n+1)x)/cos x, cos 2nx and sin 2nx/(sin x cos x) in powers of cos 2x
_SINES = ((1, 0, 0, 0), (1, 2, 0, 0), (-1, 2, 4, 0), (-1, -4, 4, 8))
_COSINES = ((1, 0, 0, 0), (-1, 2, 0, 0), (-1, -2, 4, 0), (1, -4, -4, 8))
_EVEN_COSINES = ((1, 0, 0, 0), (0, 1, 0, 0), (-1, 0, 2, 0), (0, -3, 0, 4))
_EVEN_SINES = ((0, 0, 0, 0), (2, 0, 0, 0), (0, 4, 0, 0), (-2, 0, 8, 0))


class _Half(NamedTuple):
    """A half-angle function about a turning point: polynomials of its real and imaginary part, mean growth per x."""

    real: Cubic
    imag: Cubic
    growth: float


class _Frame(NamedTuple):
    """Both half-angle functions about a turning point, with the coefficients of theta' and of b - a u."""

    near: _Half
    far: _Half
    steepness: float
    lean: Pair
    through: bool  # the axis passes through the pole: the near function is real and changes sign


class _Wave(NamedTuple):
    """The bounded part of the motion, for mgl < 0 upside down."""

    down: Array  # sqrt((1 + u)/2) and
    up: Array  # sqrt((1 - u)/2), with a sign if the axis passes through that pole
    sum_lag: Array  # (phi + psi)/2 and
    difference_lag: Array  # (phi - psi)/2, less their mean growth
    nod: Array  # theta', smooth through a pole
    precession: Array  # phi'


class ClosedForm:
    """Closed-form motion of `top` from `start` at time 0, all numbers read as exact doubles.

    Construction takes 15 ms (constants in 40 digits), evaluation 0.2 microseconds a time. Errors, measured against 50
    digits for times up to 1e6: theta 1e-15; phi and psi one unit in the last place plus 1e-15; axis and quaternion
    1e-15. Methods take times of any shape and raise `SymtopError` for any that is not finite; so does construction
    if the axis comes within 1e-145 of a pole that it does not meet.

    `nutation_period` is that of small nutations for a steady precession, and infinite where the axis stands on an
    unstable pole; `phi_per_period`, `psi_per_period` are the mean growth over it (0 if the mean rate is 0) and
    `theta_range` the two turning points, radians.

    Where the axis passes exactly through a pole, theta' changes sign, and phi and psi jump by pi there and back in
    turn; `axis`, `quaternion` and `momentum` are smooth. On a pole only phi + psi (phi - psi at pi) has a meaning.
    """

    def __init__(self, top: SymmetricTop, start: Angles) -> None:
        form = PreciseForm(top, start, digits=40)
        curve, ctx = form.curve, form.ctx
        self.top, self.start = top, start
        self.nutation_period = float(form.nutation_period)
        self.phi_per_period, self.psi_per_period = float(form.phi_per_period), float(form.psi_per_period)
        self.theta_range = (float(form.theta_range[0]), float(form.theta_range[1]))

        self._upright = form.facing > 0
        self._p_psi, self._w3 = float(form.p_psi), float(form.p_psi / form.I3)
        self._moves = bool(curve.swing != 0)
        rest = (ctx.sqrt(curve.floor.low / 2), ctx.sqrt(curve.crown.low / 2), 0, 0, 0, form.phi_rate)
        self._rest = np.array([float(value) for value in rest])
        if self._moves:
            self._signs = tuple(float(ctx.sign(pole.twist)) for pole in curve[:2])
            self._floor_sign = float(form.floor_sign)
            self._twists = tuple(float(ctx.sqrt(abs(pole.twist)) / 2) for pole in curve[:2])
            self._may_stop = self._signs[0] * self._signs[1] < 0.0  # phi' can vanish
            if any(0 < gap < 1e-290 for gap in (curve.floor.low, curve.crown.high, curve.m1)):
                raise SymtopError(
                    f"the axis must meet a pole or miss it by 1e-145 (PreciseForm takes less), not as {start!r}"
                )
            self._quarters = (pair(form.Omega / form.K), pair(form.tau0 / form.K))
            self._hyperbolic, self._scale, self._bend, self._frames = _expand(form)

        leading = [(angle - lag) / 2 for angle, lag in zip(form.angles0, form.lags0, strict=True)]
        phi0, psi0 = sum(leading), form.facing * (leading[0] - leading[1])
        self._phi_line = (pair(form.phi_rate), pair(phi0))
        self._psi_line = (pair(form.psi_rate), pair(psi0))
        self._phi_turns = turns(ctx, form.phi_rate, phi0)
        self._half_turns = tuple(turns(ctx, r / 2, s) for r, s in zip(form.mean_rates, leading, strict=True))

    def __call__(self, times: ArrayLike) -> Motion[Array]:
        """Angles and rates at `times`; every field has their shape."""
        flat, shape = _times(times)
        wave = self._wave(flat)
        cosine, sine = self._halves(wave)
        spun = wave.sum_lag - wave.difference_lag if self._upright else wave.difference_lag - wave.sum_lag
        phi = on_line(flat, self._phi_line, wave.sum_lag + wave.difference_lag)
        psi = on_line(flat, self._psi_line, spun)
        psi_dot = self._w3 - (cosine - sine) * (cosine + sine) * wave.precession
        theta_dot = wave.nod if self._upright else -wave.nod
        beyond_pi, beyond_zero = (cosine < 0.0) & (sine >= 0.0), (cosine >= 0.0) & (sine < 0.0)
        if (folded := beyond_pi | beyond_zero).any():
            theta_dot = np.where(folded, -theta_dot, theta_dot)
            phi = phi + np.pi * folded
            psi = psi + np.pi * beyond_pi - np.pi * beyond_zero
        theta = 2.0 * np.arctan2(np.abs(sine), np.abs(cosine))
        return Motion(*(part.reshape(shape) for part in (theta, phi, psi, theta_dot, wave.precession, psi_dot)))

    def quaternion(self, times: ArrayLike) -> Array:
        """Attitude (w, x, y, z), body to space, shape (..., 4); continuous in time, through poles as well."""
        flat, shape = _times(times)
        wave = self._wave(flat)
        angles = [reduced(flat, *part) for part in zip(self._half_turns, wave[2:4], strict=True)]
        (total, difference), (cosine, sine) = angles if self._upright else angles[::-1], self._halves(wave)
        first, second = cosine * np.exp(1j * total), sine * np.exp(1j * difference)
        return np.stack([first.real, second.real, second.imag, first.imag], axis=-1).reshape(*shape, 4)

    def axis(self, times: ArrayLike) -> Array:
        """Unit vector along the top's axis, shape (..., 3)."""
        flat, shape = _times(times)
        return self._axis_and_node(flat, self._wave(flat))[0].reshape(*shape, 3)

    def momentum(self, times: ArrayLike) -> Array:
        """Angular momentum L in the space frame, shape (..., 3), in units of I1 times a rate."""
        flat, shape = _times(times)
        wave = self._wave(flat)
        axis, node, sine = self._axis_and_node(flat, wave)
        nutation = (wave.nod if self._upright else -wave.nod)[:, None] * node
        precession = (wave.precession * sine)[:, None] * np.cross(axis, node)
        return (self.top.I1 * (nutation + precession) + self._p_psi * axis).reshape(*shape, 3)

    def _axis_and_node(self, times: Array, wave: _Wave) -> tuple[Array, Array, Array]:
        """Axis and line of nodes, shape (n, 3), and sin theta; node and sine both change sign beyond a pole."""
        phi = reduced(times, self._phi_turns, wave.sum_lag + wave.difference_lag)
        cosine, sine = self._halves(wave)
        across, along = 2.0 * cosine * sine, (cosine - sine) * (cosine + sine)
        x, y = np.cos(phi), np.sin(phi)
        return np.stack([across * y, -across * x, along], axis=-1), np.stack([x, y, 0.0 * x], axis=-1), across

    def _halves(self, wave: _Wave) -> tuple[Array, Array]:  # cos(theta/2), sin(theta/2)
        return (wave.down, wave.up) if self._upright else (wave.up, wave.down)

    def _wave(self, times: Array) -> _Wave:
        """The bounded part of the motion at flat `times`."""
        if not self._moves:
            return _Wave(*np.repeat(self._rest[:, None], times.size, axis=1))
        high, low = line(times, *self._quarters)
        nearest = np.rint(high)
        quarter = np.mod(nearest, 4.0).astype(np.intp)
        offset = (high - nearest) + low
        parts = np.empty((7, times.size))
        for number, order in enumerate(([0, 1, 2, 3, 4, 5, 6], [1, 0, 3, 2, 4, 5, 6])):
            pick = quarter % 2 == number
            parts[np.ix_(order, pick)] = self._about(number, offset[pick])
        for number, signs in enumerate(((1.0, 1.0, -1.0, -1.0), (1.0, -1.0, -1.0, 1.0))):  # of sn, cn beyond K, 2K, 3K
            if self._frames[number].through:
                sign = np.array(signs)[quarter] * (1.0 if number else self._floor_sign)
                parts[number] *= sign
                parts[4] *= sign
        down, up, sum_lag, difference_lag, nod, lean, size = parts
        return _Wave(down, up, sum_lag, difference_lag, nod, self._precession(down, up, lean, size))

    def _precession(self, down: Array, up: Array, lean: Array, size: Array) -> Array:
        """phi' as the sum of its two fractions, or as lean/sin^2 theta where these cancel more than lean did."""
        rate, fractions = np.zeros_like(down), np.zeros_like(down)
        for half, twist, sign in zip((down, up), self._twists, self._signs, strict=True):
            if sign:
                fraction = (twist / half) ** 2
                rate, fractions = rate + sign * fraction, fractions + fraction
        if self._may_stop:
            sine2 = (2.0 * down * up) ** 2
            return np.where(size < fractions * sine2, lean / sine2, rate)
        return rate

    def _about(self, number: int, offset: Array) -> tuple[Array, ...]:
        """Moduli and lags of the halves, theta', b - a u and the size of its terms; x = `offset` from u1 or u2."""
        frame, angle = self._frames[number], self._scale * offset
        near, far = frame.near, frame.far
        if self._hyperbolic:
            odd, even = np.sinh(angle), np.cosh(angle)
            twice = 1.0 + 2.0 * odd * odd
            far_real, far_imag = _cubic(far.real, twice), odd * even * _cubic(far.imag, twice)
        else:
            odd, even = np.sin(angle), np.cos(angle)
            twice = 1.0 - 2.0 * odd * odd
            far_real, far_imag = even * _cubic(far.real, twice), odd * _cubic(far.imag, twice)
        near_odd = _cubic(near.imag, twice)
        near_real, near_imag = even * _cubic(near.real, twice), odd * near_odd
        far_size = np.hypot(far_real, far_imag)
        near_size = near_imag if frame.through else np.hypot(near_real, near_imag)
        per_near = 1.0 / near_odd if frame.through else odd / near_size
        square = near_size * near_size + far_size * far_size  # theta_4(z)^2
        nod = frame.steepness * even * per_near * _cubic(self._bend, 2.0 * twice * twice - 1.0) / (far_size * square)
        leaning = frame.lean[1] * (odd * _cubic(self._bend, twice)) ** 2 / square
        lean, size = frame.lean[0] + leaning, abs(frame.lean[0]) + np.abs(leaning)
        near_lag = self._signs[number] * (np.arctan2(near_imag, near_real) - near.growth * offset)
        far_lag = self._signs[1 - number] * (np.arctan2(far_imag, far_real) - far.growth * offset)
        norm = np.sqrt(square)
        return near_size / norm, far_size / norm, near_lag, far_lag, nod, lean, size


def _expand(form: PreciseForm) -> tuple[bool, float, Cubic, tuple[_Frame, ...]]:
    """Coefficients about the turning points u1 (near the floor) and u2 (near the crown), scaled to moduli of 1."""
    ctx, curve, hyperbolic = form.ctx, form.curve, bool(form.m > 0.5)
    period, other = (form.K1, form.K) if hyperbolic else (form.K, form.K1)
    nome = ctx.exp(-ctx.pi * other / period) if form.m else ctx.zero
    heights = [ctx.pi * height / (2 * period) for height in form.zero_heights()]
    halves = [(_hyperbolic_halves if hyperbolic else _trigonometric_halves)(ctx, y, nome) for y in heights]
    growths = [float(ctx.pi / 2 - (y if hyperbolic else 0)) for y in heights]
    scale, bend = ctx.pi * form.K / (2 * period), _series(_SINES, _weights(ctx, nome))
    floor, crown, frames = curve.floor, curve.crown, []
    for near, side, least, most, grows in ((0, 1, floor.low, crown.low, 1), (1, -1, crown.high, floor.high, form.m1)):
        near_real, near_imag, _, _ = halves[near]
        _, _, far_real, far_imag = halves[1 - near]
        depth = curve.swing * grows * (form.K / scale) ** 2  # abs(u - u_near) = depth angle^2
        near_unit = ctx.sqrt(least / 2) / sum(near_real) if least else ctx.sqrt(depth / 2) / sum(near_imag)
        far_unit = ctx.sqrt(most / 2) / sum(far_real)
        leaning = (floor.twist * crown[1 + near] + crown.twist * floor[1 + near]) / 2  # b - a u_near
        lean = (float(leaning), float(-side * form.facing * form.a * depth / sum(bend) ** 2))
        steepness = float(-side * form.Omega * depth * scale / form.K / sum(bend))
        near_half = _Half(_floats(near_real, near_unit), _floats(near_imag, near_unit), growths[near])
        far_half = _Half(_floats(far_real, far_unit), _floats(far_imag, far_unit), growths[1 - near])
        frames.append(_Frame(near_half, far_half, steepness, lean, through=bool(least == 0)))
    return hyperbolic, float(scale), _floats(bend, 1), tuple(frames)


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
    scaled = ([weight * power for power in powers] for weight, powers in zip(weights, basis, strict=True))
    return [sum(column) for column in zip(*scaled, strict=True)]


def _floats(values: list[Any], unit: Any) -> Cubic:
    return float(unit * values[0]), float(unit * values[1]), float(unit * values[2]), float(unit * values[3])


def _cubic(coefficients: Cubic, x: Array) -> Array:
    return coefficients[0] + x * (coefficients[1] + x * (coefficients[2] + x * coefficients[3]))


def _times(times: ArrayLike) -> tuple[Array, tuple[int, ...]]:
    array = np.asarray(times, dtype=np.float64)
    if (bad := array[~(np.abs(array) <= 1e100)]).size:
        raise SymtopError(f"times must be finite numbers of at most 1e100 in size, not {float(bad[0])!r}")
    return array.ravel(), array.shape
