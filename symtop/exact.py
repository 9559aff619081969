"""Closed-form motion of the heavy symmetric top in double precision, vectorised over time.

The attitude is written in the two complex half-angle functions of Klein and Sommerfeld,

    A = cos(theta/2) exp(i (phi + psi)/2),        B = sin(theta/2) exp(i (phi - psi)/2),

which are quotients theta_k(z - i y)/theta_4(z), z = pi tau/2K, times an exponential (constants: `symtop.exact_mp`).
theta_4 is common to both and cancels in every angle. About each turning point, at x quarter periods from it, one
function belongs to the pole that the axis is near and one to the pole that it is far from; up to a common real factor,
with polynomials P of degree 3 in C,

    m <= 1/2    near, far = cos z P + i sin z P,                       z = pi x/2,      C = cos 2z,   nome exp(-pi K'/K)
    m >  1/2    near = cosh s P + i sinh s P, far = P + i sinh 2s P,   s = pi K x/2K',  C = cosh 2s,  nome exp(-pi K/K')

The second line is Jacobi's imaginary transformation. The nome is at most exp(-pi) = 0.043 either way, so that the first
dropped term is below 1e-19, m -> 1 is no special case, and m = 0 is trigonometry. As abs(x) <= 1/2, everything is
relatively accurate at both turning points, however closely the axis grazes a pole there. Then

    theta = 2 atan2(abs B, abs A),        (phi +- psi)/2 = mean rate t + (argument - its mean growth) + const.

The phase and the secular angles are products of t with rates of two doubles, so that the error of theta does not grow
with time, and that of phi and psi only as their last digit does. Cost: 0.3 microseconds a time; no special functions.
Sources: Klein and Sommerfeld, Theory of the Top, chapter 6; Whittaker and Watson, A Course of Modern Analysis,
chapter 21. Not to be confused with the small-nutation approximation: nothing is expanded in the amplitude.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symtop.charts import Array
from symtop.checks import SymtopError
from symtop.top import Angles, SymmetricTop

Pair = tuple[float, float]  # an unevaluated sum of two doubles
Cubic = tuple[float, float, float, float]

_LONGEST_TIME = 1e100

# sin((2n+1)x)/sin x, cos((2n+1)x)/cos x, cos 2nx and sin 2nx/sin 2x as polynomials in cos 2x, lowest power first
_SINES = ((1, 0, 0, 0), (1, 2, 0, 0), (-1, 2, 4, 0), (-1, -4, 4, 8))
_COSINES = ((1, 0, 0, 0), (-1, 2, 0, 0), (-1, -2, 4, 0), (1, -4, -4, 8))
_FIRST_KIND = ((1, 0, 0, 0), (0, 1, 0, 0), (-1, 0, 2, 0), (0, -3, 0, 4))
_SECOND_KIND = ((0, 0, 0, 0), (1, 0, 0, 0), (0, 2, 0, 0), (-1, 0, 4, 0))


class Motion(NamedTuple):
    """Euler angles (radians, theta in [0, pi], phi and psi unwrapped) and their rates; arrays shaped as the times."""

    theta: Array
    phi: Array
    psi: Array
    theta_dot: Array
    phi_dot: Array
    psi_dot: Array


class _Half(NamedTuple):
    """A half-angle function about a turning point: polynomials of its real and imaginary part, mean growth per x."""

    real: Cubic
    imag: Cubic
    growth: float


class _Frame(NamedTuple):
    """Both half-angle functions about one turning point, and the coefficient of u' there."""

    near: _Half
    far: _Half
    steepness: float
    through: bool  # the axis passes through the pole: the near function is real and changes sign


class _Wave(NamedTuple):
    """The bounded part of the motion, for mgl < 0 upside down."""

    down: Array  # sqrt((1 + u)/2), with a sign if the axis passes through a pole
    up: Array  # sqrt((1 - u)/2), likewise
    sum_lag: Array  # (phi + psi)/2 less its mean growth
    difference_lag: Array  # (phi - psi)/2, likewise
    nod: Array  # theta', smooth through a pole


class ClosedForm:
    """Closed-form motion of `top` from `start` at time 0, all numbers read as exact doubles.

    Construction takes 15 ms (constants in 40 digits), evaluation 0.3 microseconds a time. Errors, measured against 50
    digits for times up to 1e6: theta 1e-15; phi and psi one unit in the last place plus 1e-15; axis and quaternion
    1e-15. Methods take times of any shape and raise `SymtopError` for any that is not finite.

    `nutation_period` is that of small nutations for a steady precession, and infinite where the axis stands on an
    unstable pole; `phi_per_period`, `psi_per_period` are the mean growth over it (0 if the mean rate is 0) and
    `theta_range` the two turning points, radians.

    Where the axis passes exactly through a pole, theta' changes sign and phi and psi jump by pi there and back in
    turn; `axis`, `quaternion` and `momentum` are smooth. On a pole only phi + psi (phi - psi at theta = pi) has a meaning.
    """

    def __init__(self, top: SymmetricTop, start: Angles) -> None:
        from symtop.exact_mp import PreciseForm  # noqa: PLC0415  (mpmath costs 0.1 s to import)

        form = PreciseForm(top, start, digits=40)
        curve, ctx = form.curve, form.ctx
        self.top, self.start = top, start
        self.nutation_period = float(form.nutation_period)
        self.phi_per_period, self.psi_per_period = float(form.phi_per_period), float(form.psi_per_period)
        self.theta_range = (float(form.theta_range[0]), float(form.theta_range[1]))

        self._upright = form.facing > 0
        self._p_psi, self._w3 = float(form.p_psi), float(form.p_psi / form.I3)
        self._twists = tuple(float(np.sign(float(pole.twist))) for pole in curve[:2])
        self._floor_sign = float(form.floor_sign)
        self._passing = tuple(
            (float(pole.twist / (2 * least)), float(ctx.sqrt(least / 2))) if pole.twist else (0.0, 0.0)
            for pole, least in ((curve.floor, curve.floor.low), (curve.crown, curve.crown.high))
        )
        self._fixed = (float(ctx.sqrt(curve.floor.low / 2)), float(ctx.sqrt(curve.crown.low / 2)))
        self._moves = bool(curve.swing != 0)
        if self._moves:
            self._quarters = (_pair(form.Omega / form.K), _pair(form.tau0 / form.K))
            self._hyperbolic, self._scale, self._bend, self._frames = _expand(form)

        lags = [lag / 2 for lag in form.start_lags()]
        ahead = {"phi": lags[0] + lags[1], "psi": form.facing * (lags[0] - lags[1])}
        self._phi_line = (_pair(form.phi_rate), _pair(form.phi0 - ahead["phi"]))
        self._psi_line = (_pair(form.psi_rate), _pair(form.psi0 - ahead["psi"]))
        self._phi_turns = _turns(ctx, form.phi_rate, form.phi0 - ahead["phi"])
        half_sum, half_difference = (form.phi0 + form.facing * form.psi0) / 2, (form.phi0 - form.facing * form.psi0) / 2
        self._sum_turns = _turns(ctx, form.sum_rate / 2, half_sum - lags[0])
        self._difference_turns = _turns(ctx, form.difference_rate / 2, half_difference - lags[1])

    def __call__(self, times: ArrayLike) -> Motion:
        """Angles and rates at `times`; every field has their shape."""
        flat, shape = _times(times)
        wave = self._wave(flat)
        cosine, sine = self._halves(wave)
        phi = _on_line(flat, self._phi_line, wave.sum_lag + wave.difference_lag)
        leading, other = (wave.sum_lag, wave.difference_lag) if self._upright else (wave.difference_lag, wave.sum_lag)
        psi = _on_line(flat, self._psi_line, leading - other)
        phi_dot = self._precession(wave)
        psi_dot = self._w3 - (cosine - sine) * (cosine + sine) * phi_dot
        theta_dot = wave.nod if self._upright else -wave.nod
        if self._moves and any(frame.through for frame in self._frames):
            beyond_pi, beyond_zero = cosine < 0.0, sine < 0.0
            folded = beyond_pi != beyond_zero
            theta_dot = np.where(folded, -theta_dot, theta_dot)
            phi = phi + np.where(folded, np.pi, 0.0)
            psi = psi + np.where(folded, np.where(beyond_pi, np.pi, -np.pi), 0.0)
        theta = 2.0 * np.arctan2(np.abs(sine), np.abs(cosine))
        return Motion(*(part.reshape(shape) for part in (theta, phi, psi, theta_dot, phi_dot, psi_dot)))

    def quaternion(self, times: ArrayLike) -> Array:
        """Attitude (w, x, y, z), body to space, shape (..., 4); continuous in time, through poles as well."""
        flat, shape = _times(times)
        wave = self._wave(flat)
        total = _reduced(flat, self._sum_turns, wave.sum_lag)
        difference = _reduced(flat, self._difference_turns, wave.difference_lag)
        cosine, sine = self._halves(wave)
        first, second = (total, difference) if self._upright else (difference, total)
        parts = (cosine * np.cos(first), sine * np.cos(second), sine * np.sin(second), cosine * np.sin(first))
        return np.stack(parts, axis=-1).reshape(*shape, 4)

    def axis(self, times: ArrayLike) -> Array:
        """Unit vector along the top's axis, shape (..., 3)."""
        flat, shape = _times(times)
        axis, _, _ = self._axis_and_node(flat, self._wave(flat))
        return axis.reshape(*shape, 3)

    def momentum(self, times: ArrayLike) -> Array:
        """Angular momentum L in the space frame, shape (..., 3), in units of I1 times a rate."""
        flat, shape = _times(times)
        wave = self._wave(flat)
        axis, node, sine = self._axis_and_node(flat, wave)
        theta_dot = wave.nod if self._upright else -wave.nod
        nutation = self.top.I1 * theta_dot[:, None] * node
        precession = (self.top.I1 * self._precession(wave) * sine)[:, None] * np.cross(axis, node)
        return (nutation + precession + self._p_psi * axis).reshape(*shape, 3)

    def _axis_and_node(self, times: Array, wave: _Wave) -> tuple[Array, Array, Array]:
        """Axis and line of nodes, shape (n, 3), and sin theta; node and sine both change sign beyond a pole."""
        phi = _reduced(times, self._phi_turns, wave.sum_lag + wave.difference_lag)
        cosine, sine = self._halves(wave)
        across, along = 2.0 * cosine * sine, (cosine - sine) * (cosine + sine)
        x, y = np.cos(phi), np.sin(phi)
        return np.stack([across * y, -across * x, along], axis=-1), np.stack([x, y, 0.0 * x], axis=-1), across

    def _halves(self, wave: _Wave) -> tuple[Array, Array]:
        """cos(theta/2) and sin(theta/2)."""
        return (wave.down, wave.up) if self._upright else (wave.up, wave.down)

    def _precession(self, wave: _Wave) -> Array:
        """phi' = (b + a)/(2 (1 + u)) + (b - a)/(2 (1 - u)); as ratios, since the squares may underflow."""
        rate = np.zeros_like(wave.down)
        for half, (fastest, least) in zip((wave.down, wave.up), self._passing, strict=True):
            if fastest:
                rate += fastest * (least / half) ** 2
        return rate

    def _wave(self, times: Array) -> _Wave:
        """The bounded part of the motion at flat `times`."""
        if not self._moves:
            rest = np.zeros_like(times)
            return _Wave(rest + self._fixed[0], rest + self._fixed[1], rest, rest, rest)
        high, low = _line(times, *self._quarters)
        nearest = np.rint(high)
        quarter = np.mod(nearest, 4.0).astype(np.intp)
        offset = (high - nearest) + low
        parts = np.empty((5, times.size))
        for number, frame in enumerate(self._frames):
            pick = quarter % 2 == number
            near, far, near_lag, far_lag, nod = self._about(
                frame, offset[pick], self._twists[number], self._twists[1 - number]
            )
            swap = (near, far, near_lag, far_lag) if number == 0 else (far, near, far_lag, near_lag)
            parts[:, pick] = (*swap, nod)
        if self._frames[0].through:  # sn changes sign at every other multiple of K, cn in between
            sign = np.array([1.0, 1.0, -1.0, -1.0])[quarter] * self._floor_sign
            parts[0] *= sign
            parts[4] *= sign
        if self._frames[1].through:
            sign = np.array([1.0, -1.0, -1.0, 1.0])[quarter]
            parts[1] *= sign
            parts[4] *= sign
        return _Wave(*parts)

    def _about(self, frame: _Frame, offset: Array, near_twist: float, far_twist: float) -> tuple[Array, ...]:
        """Near and far function (modulus, lag) and theta' at `offset` quarter periods from a turning point."""
        angle = self._scale * offset
        if self._hyperbolic:
            odd, even = np.sinh(angle), np.cosh(angle)
            twice = 1.0 + 2.0 * odd * odd
            far_real, far_imag = _cubic(frame.far.real, twice), odd * even * _cubic(frame.far.imag, twice)
        else:
            odd, even = np.sin(angle), np.cos(angle)
            twice = 1.0 - 2.0 * odd * odd
            far_real, far_imag = even * _cubic(frame.far.real, twice), odd * _cubic(frame.far.imag, twice)
        near_real, near_imag = even * _cubic(frame.near.real, twice), odd * _cubic(frame.near.imag, twice)
        far = np.hypot(far_real, far_imag)
        near = near_imag if frame.through else np.hypot(near_real, near_imag)
        square = near * near + far * far
        bend = frame.steepness * even * _cubic(self._bend, 2.0 * twice * twice - 1.0)
        per_near = 1.0 / _cubic(frame.near.imag, twice) if frame.through else odd / near
        size = 1.0 / np.sqrt(square)
        return (
            near * size,
            far * size,
            _lag(near_twist, near_imag, near_real, frame.near.growth * offset),
            _lag(far_twist, far_imag, far_real, frame.far.growth * offset),
            -0.5 * bend * per_near / (far * square),
        )


def _lag(twist: float, imag: Array, real: Array, growth: Array) -> Array:
    return twist * (np.arctan2(imag, real) - growth) if twist else np.zeros_like(growth)


def _expand(form: Any) -> tuple[bool, float, Cubic, tuple[_Frame, _Frame]]:
    """Coefficients about the turning points u1 (near the floor) and u2 (near the crown)."""
    ctx, curve = form.ctx, form.curve
    hyperbolic = bool(form.m > 0.5)
    period, other = (form.K1, form.K) if hyperbolic else (form.K, form.K1)
    nome = ctx.exp(-ctx.pi * other / period) if form.m else ctx.zero
    scale = ctx.pi * form.K / (2 * period)
    bend = _series(_SINES, [(-1) ** n * nome ** (n * (n + 1)) if n else 1 for n in range(4)])
    frames = []
    heights = [ctx.pi * height / (2 * period) for height in form.zero_heights()]
    for near, far, least, most, growing in (
        (0, 1, curve.floor.low, curve.crown.low, ctx.one),
        (1, 0, curve.crown.high, curve.floor.high, form.m1),
    ):
        expand = _hyperbolic_halves if hyperbolic else _trigonometric_halves
        near_real, near_imag, _, _ = expand(ctx, heights[near], nome)
        _, _, far_real, far_imag = expand(ctx, heights[far], nome)
        rise = ctx.sqrt(curve.swing * growing / 2) * form.K / scale
        size = ctx.sqrt(least / 2) / sum(near_real) if least else rise / sum(near_imag)
        steepness = 2 * form.Omega * curve.swing * growing * form.K / (scale * sum(bend)) * (1 if near == 0 else -1)
        growth = [ctx.pi / 2 - (height if hyperbolic else 0) for height in (heights[near], heights[far])]
        far_size = ctx.sqrt(most / 2) / sum(far_real)
        frames.append(
            _Frame(
                _Half(_floats(near_real, size), _floats(near_imag, size), float(growth[0])),
                _Half(_floats(far_real, far_size), _floats(far_imag, far_size), float(growth[1])),
                float(steepness),
                bool(least == 0),
            )
        )
    return hyperbolic, float(scale), _floats(bend, 1), (frames[0], frames[1])


def _trigonometric_halves(ctx: Any, y: Any, nome: Any) -> tuple[list[Any], ...]:
    """i theta_1(z - i y) and theta_2(z - i y): factors of cos z and i sin z, as polynomials in cos 2z."""
    weights = [nome ** (n * (n + 1)) if n else ctx.one for n in range(4)]
    signs = (1, -1, 1, -1)
    cosh, sinh = ([f((2 * n + 1) * y) * w for n, w in enumerate(weights)] for f in (ctx.cosh, ctx.sinh))
    return (
        _series(_COSINES, [sign * value for sign, value in zip(signs, sinh, strict=True)]),
        _series(_SINES, [sign * value for sign, value in zip(signs, cosh, strict=True)]),
        _series(_COSINES, cosh),
        _series(_SINES, sinh),
    )


def _hyperbolic_halves(ctx: Any, y: Any, nome: Any) -> tuple[list[Any], ...]:
    """theta_1(y + i s), factors of cosh s and i sinh s, and theta_4(y + i s), of 1 and i sinh s cosh s; in cosh 2s."""
    odd = [(-1) ** n * nome ** (n * (n + 1)) for n in range(4)]
    even = [2 * (-1) ** n * nome ** (n * n) if n else ctx.one for n in range(4)]
    return (
        _series(_COSINES, [weight * ctx.sin((2 * n + 1) * y) for n, weight in enumerate(odd)]),
        _series(_SINES, [weight * ctx.cos((2 * n + 1) * y) for n, weight in enumerate(odd)]),
        _series(_FIRST_KIND, [weight * ctx.cos(2 * n * y) for n, weight in enumerate(even)]),
        _series(_SECOND_KIND, [-2 * weight * ctx.sin(2 * n * y) for n, weight in enumerate(even)]),
    )


def _series(basis: tuple[tuple[int, ...], ...], weights: list[Any]) -> list[Any]:
    return [sum(weight * powers[k] for weight, powers in zip(weights, basis, strict=True)) for k in range(4)]


def _floats(values: list[Any], size: Any) -> Cubic:
    a, b, c, d = (float(size * value) for value in values)
    return a, b, c, d


def _cubic(coefficients: Cubic, x: Array) -> Array:
    a, b, c, d = coefficients
    return a + x * (b + x * (c + x * d))


def _times(times: ArrayLike) -> tuple[Array, tuple[int, ...]]:
    array = np.asarray(times, dtype=np.float64)
    if not np.all(np.abs(array) <= _LONGEST_TIME):
        msg = f"times must be finite numbers of at most {_LONGEST_TIME:g}, not {array[~(np.abs(array) <= _LONGEST_TIME)][0]!r}"
        raise SymtopError(msg)
    return array.ravel(), array.shape


def _pair(value: Any) -> Pair:
    high = float(value)
    return high, float(value - high)


def _turns(ctx: Any, rate: Any, start: Any) -> tuple[Pair, Pair]:
    """A line of angles in turns, its start reduced to the nearest to zero."""
    start = start / (2 * ctx.pi)
    return _pair(rate / (2 * ctx.pi)), _pair(start - ctx.nint(start))


def _line(times: Array, rate: Pair, start: Pair) -> tuple[Array, Array]:
    """start + rate x times as a sum of two doubles (Dekker's product, Knuth's sum)."""
    product = times * rate[0]
    total = product + start[0]
    added = total - product
    rounding = (product - (total - added)) + (start[0] - added)
    return total, _product_error(times, rate[0], product) + (rounding + (times * rate[1] + start[1]))


def _product_error(x: Array, y: float, product: Array) -> Array:
    scaled = 134217729.0 * x
    x_high = scaled - (scaled - x)
    y_scaled = 134217729.0 * y
    y_high = y_scaled - (y_scaled - y)
    x_low, y_low = x - x_high, y - y_high
    return ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low


def _on_line(times: Array, line: tuple[Pair, Pair], lag: Array) -> Array:
    high, low = _line(times, *line)
    return high + (low + lag)


def _reduced(times: Array, turns: tuple[Pair, Pair], lag: Array) -> Array:
    """An angle to within whole turns, so that its error does not grow with time."""
    high, low = _line(times, *turns)
    return 2.0 * np.pi * ((high - np.rint(high)) + low) + lag
