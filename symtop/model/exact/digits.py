"""Closed-form motion of the heavy symmetric top in arbitrary precision: the one derivation of its constants.

With u = cos theta, a = p_psi/I1, b = p_phi/I1, beta = 2 mgl/I1, alpha = theta'^2 + phi'^2 sin^2 theta + beta u,

    u'^2 = (1 - u^2)(alpha - beta u) - (b - a u)^2 = beta (u - u1)(u - u2)(u - u3),   -1 <= u1 <= u2 <= 1 <= u3,
    u    = u1 + (u2 - u1) sn^2(tau | m),    tau = tau0 + Omega t,    4 Omega^2 = beta (u3 - u1),
    m    = (u2 - u1)/(u3 - u1),             nutation period 2 K(m)/Omega.

Each pole has a distance (floor: d = 1 + u, crown: d = 1 - u) and a twist (floor: b + a, crown: b - a), and with
drift = a (I1/I3 - 1) the two natural angles obey

    (phi + psi)' = drift + (b + a)/(1 + u),        (phi - psi)' = -drift + (b - a)/(1 - u),

each an integral of the third kind, int dtau/d = Pi(n; tau)/d1 with n = (d1 - d2)/d1, d1 and d2 being the distances
at u1 and u2. Carlson's form Pi = s RF(c^2, D, 1) + (n/3) s^3 RJ(c^2, D, 1, d/d1), D = m1 + m c^2, has no cancellation
near a pole. A hanging top (mgl < 0) is the standing one seen upside down: theta -> pi - theta, psi -> -psi.

Degenerate tops. The coefficients of u'^2 about the starting point are sums of an exact fraction and a multiple of
cos theta. One that vanishes is therefore known to vanish (an axis that passes through a pole, a start on a turning
point, a steady precession); every other gap between roots is a nonzero number that enough digits resolve, and the
precision is doubled until they do. The only separatrix (m = 1) that rational data can name starts at theta = 0 in a
hanging top without twist: theta'^2 I1 = 4 abs(mgl), and theta = 4 atan tanh(g t/2), g = Omega = sqrt(abs(mgl)/I1).

Conventions where angles are singular. If the axis passes exactly through a pole, the twist there is 0, its term is
dropped, and phi and psi jump by pi there and back in turn. If the axis stands on a pole only phi + psi (phi - psi
at the lower one) has a meaning, and the other twist alone gives phi' = +-a/2.

Inputs are read without rounding: a float is the exact binary fraction it stores, a string the exact decimal it shows.
`precise_constants` rounds a form once to the constants of `symtop.model.exact.closed_form`. The error does not grow
with time, except that a time of 10^k periods costs k of the 30 guard digits. Sources: Klein and Sommerfeld, Theory of
the Top, chapter 6; Goldstein, Classical Mechanics, section 5.7; Carlson, Numerical Algorithms 10 (1995) 13.
"""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from symtop.core.errors import SymtopError, whole
from symtop.model.charts import Array
from symtop.model.exact import layout as at
from symtop.model.top import NUMBERS, Angles, SymmetricTop


def rationals(top: SymmetricTop | Sequence[Any], start: Angles | Sequence[Any]) -> list[list[Fraction]]:
    """Parameters and start as exact fractions, checked against the model."""
    body = [top.I1, top.I3, top.mgl] if isinstance(top, SymmetricTop) else list(top)
    state = [getattr(start, name) for name in NUMBERS[3:]] if isinstance(start, Angles) else list(start)
    if len(body) != 3 or len(state) != 6:
        counts = f"{len(body)} and {len(state)} numbers"
        raise SymtopError(f"the closed form takes (I1, I3, mgl) and six angles and rates, not {counts}")
    values = [rational(name, value) for name, value in zip(NUMBERS, [*body, *state], strict=True)]
    SymmetricTop(*map(float, values[:3]))
    Angles(*map(float, values[3:]))
    return [values[:3], values[3:]]


def rational(name: str, value: Any) -> Fraction:
    """The exact value of a float, integer, fraction, decimal string or mpf."""
    from mpmath.libmp import to_rational

    try:
        if hasattr(value, "_mpf_"):
            return Fraction(*map(int, to_rational(value._mpf_)))
        return Fraction(value if isinstance(value, str | int | Fraction) else float(value))
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        raise SymtopError(f"{name} must be a finite number or a decimal string, not {value!r}") from None


def real_roots(ctx: Any, c0: Any, c1: Any, c2: Any, c3: Any) -> tuple[Any, ...]:
    """Roots of c0 + c1 x + c2 x^2 + c3 x^3, all real, x1 <= 0 <= x2 <= x3; c0, c3 >= 0. Infinite x3 if c3 = 0.

    A double root at 0 is returned as x1 = x2 = 0 wherever the third lies.
    """
    if c0 == 0 and c1 == 0:
        return ctx.zero, ctx.zero, -c2 / c3 if c3 else ctx.inf
    if c3 == 0:
        return *quadratic_roots(ctx, c0, c1, c2), ctx.inf
    if c0 == 0:
        return tuple(sorted([ctx.zero, *quadratic_roots(ctx, c1, c2, c3)]))
    shift = c2 / (3 * c3)
    p, q = c1 / c3 - 3 * shift**2, 2 * shift**3 - shift * c1 / c3 + c0 / c3
    radius = ctx.sqrt(max(-p / 3, 0))
    angle = ctx.acos(min(max(1.5 * q / (p * radius), -1), 1)) / 3 if radius else ctx.zero
    roots = [2 * radius * ctx.cos(angle - 2 * ctx.pi * k / 3) - shift for k in range(3)]
    for _ in range(5):  # Newton: near a double or triple root the cosines keep only a half or a quarter of the digits
        slopes = [c1 + x * (2 * c2 + 3 * x * c3) for x in roots]
        values = [c0 + x * (c1 + x * (c2 + x * c3)) for x in roots]
        roots = [x - v / s if s else x for x, v, s in zip(roots, values, slopes, strict=True)]
    return tuple(sorted(roots))


def quadratic_roots(ctx: Any, c0: Any, c1: Any, c2: Any) -> list[Any]:
    """Real roots of c0 + c1 x + c2 x^2 in order, without cancellation."""
    root = ctx.sqrt(max(c1 * c1 - 4 * c0 * c2, 0))
    q = -(c1 + (root if c1 > 0 else -root)) / 2
    return sorted([q / c2, c0 / q])


GUARD_DIGITS, MOST_DIGITS = 30, 20_000  # the latter resolves relative gaps between roots down to 1e-5000
Number = TypeVar("Number")


class Motion(NamedTuple, Generic[Number]):
    """Euler angles (radians, theta in [0, pi], phi and psi unwrapped) and their rates: arrays or `mpmath.mpf`."""

    theta: Number
    phi: Number
    psi: Number
    theta_dot: Number
    phi_dot: Number
    psi_dot: Number


class Pole(NamedTuple):
    """Numbers of a pole: its twist b +- a, and distances 1 +- u at the turning points u1 (low) and u2 (high)."""

    twist: Any
    low: Any
    high: Any


class Curve(NamedTuple):
    """The elliptic curve of u(t) and the starting point on it."""

    floor: Pole
    crown: Pole
    swing: Any  # u2 - u1
    third: Any  # u3
    stiffness: Any  # beta (u3 - u1) = 4 Omega^2
    m: Any
    m1: Any  # 1 - m
    beyond: Any  # (u3 - 1)/(u3 - u2)
    start_sn2: Any
    start_cn2: Any


class PreciseForm:
    """Closed-form motion to `digits` significant digits.

    `top` is a `SymmetricTop` or a sequence (I1, I3, mgl), `start` an `Angles` or a sequence (theta, phi, psi, theta',
    phi', psi'); entries may be floats, integers, fractions, decimal strings or mpf. Raises `SymtopError` for values
    outside the model.

    Constants: `a`, `b`, `alpha`, `beta`, `energy`, `p_phi`, `p_psi`, `roots` (ascending; a free top has one at
    infinity), `m`, `K`, `Omega`, `nutation_period` (that of small nutations for a steady precession, infinite where
    none exists), `phi_per_period`, `psi_per_period`, `theta_range`: numbers of the private mpmath context `ctx`. For
    mgl < 0 `curve` is that of the top upside down, and `facing` is -1.
    """

    def __init__(self, top: SymmetricTop | Sequence[Any], start: Angles | Sequence[Any], digits: int = 30) -> None:
        from mpmath.ctx_mp import MPContext  # mpmath costs 0.1 s to import

        self.digits = whole("digits", digits, 1)
        self.ctx: Any = MPContext()  # private: the precision of the caller's mpmath is neither used nor changed
        body, state = rationals(top, start)
        self.facing = -1 if body[2] < 0 else 1
        self.ctx.dps = 4 * (self.digits + GUARD_DIGITS)
        while not self._resolve(body, state):
            self.ctx.dps *= 2
            if self.ctx.dps > MOST_DIGITS:
                words = f"the turning points must be separable with {MOST_DIGITS} digits"
                raise SymtopError(f"{words}; these values are too extreme")
        self._set_periods(body, state)
        self._last: tuple[Fraction, tuple[Any, Any, Any, Any, Any]] | None = None  # a time and its state

    def _resolve(self, body: list[Fraction], state: list[Fraction]) -> bool:
        """Invariants and turning points; False if the present precision does not tell all gaps from zero."""
        ctx, real, facing = self.ctx, self._real, self.facing
        I1, I3, mgl = body
        theta, _, _, theta_dot, phi_dot, psi_dot = state
        half, cosine = real(theta) / 2, ctx.cos(real(theta))
        above, below = 2 * ctx.sin(half) ** 2, 2 * ctx.cos(half) ** 2  # 1 - cos theta, 1 + cos theta
        sine2 = above * below

        lean = real((I1 - I3) * phi_dot) * cosine
        north = above * (real(I1 * phi_dot - I3 * psi_dot) + lean) / real(I1)  # b - a
        south = below * (real(I1 * phi_dot + I3 * psi_dot) - lean) / real(I1)  # b + a
        torque = 2 * (real(I3 * phi_dot * psi_dot - mgl) + real((I3 - I1) * phi_dot**2) * cosine) / real(I1)
        spin = real(psi_dot) + real(phi_dot) * cosine
        self.a, self.b, self.beta = real(I3 / I1) * spin, (north + south) / 2, real(2 * mgl / I1)
        kinetic = real(theta_dot**2) + real(phi_dot**2) * sine2
        self.alpha = kinetic + self.beta * cosine
        self.energy = real(I1 / 2) * self.alpha + real(I3 / 2) * spin**2

        lead = facing * self.beta
        curvature = 2 * self.beta * cosine - kinetic - self.a**2
        slope = facing * (sine2 * torque - 2 * cosine * real(theta_dot**2))
        fall = sine2 * real(theta_dot**2)  # u'^2 at the start
        x1, x2, x3 = real_roots(ctx, fall, slope, curvature, lead)  # of u'^2 in u - u(0)
        product = x1 * x2 * (-lead * x3 if lead else curvature)
        if abs(product - fall) > abs(product) * ctx.mpf(10) ** -20:  # noise has moved a root beside a double one
            return False
        up, down, twist_up, twist_down = (above, below, north, south) if facing > 0 else (below, above, south, north)
        rests = x1 == x2
        if twist_down == 0 and not rests:
            x1 = -down
        if twist_up == 0 and not rests:
            x2, x3 = (up, x3) if abs(x2 - up) <= abs(x3 - up) else (x2, up)
        self.climbs = theta == 0 and phi_dot + psi_dot == 0 and theta_dot**2 * I1 == -4 * mgl != 0
        if self.climbs:
            x1, x2, x3 = ctx.zero, up, up
        if lead and x2 == x3 and not (rests or self.climbs):  # the gap has cancelled
            return False
        rigid = rests or not lead  # no elliptic function needed
        self.curve = Curve(
            floor=Pole(twist_down, down + x1, down + x2),
            crown=Pole(twist_up, up - x1, up - x2),
            swing=x2 - x1,
            third=facing * cosine + x3,
            stiffness=-curvature if rigid else lead * (x3 - x1),
            m=ctx.zero if rigid else (x2 - x1) / (x3 - x1),
            m1=ctx.one if rigid else (x3 - x2) / (x3 - x1),
            beyond=ctx.one if rigid or self.climbs else (x3 - up) / (x3 - x2),
            start_sn2=ctx.zero if rests else -x1 / (x2 - x1),
            start_cn2=ctx.one if rests else x2 / (x2 - x1),
        )
        if not rests and any(pole.twist and not (pole.low and pole.high) for pole in self.curve[:2]):
            return False
        span = 1 + (abs(curvature / lead) if lead else 0)
        gaps = [*self.curve.floor[1:], *self.curve.crown[1:], self.curve.swing, *self.curve[5:]]
        smallest = min(gap for gap in gaps if gap != 0)
        if smallest < span * ctx.mpf(10) ** (-ctx.dps // 4):  # hidden by rounding errors
            return False
        decades = int(0.30103 * (ctx.mag(span) - ctx.mag(smallest))) + 1
        ctx.dps = self.digits + GUARD_DIGITS + decades
        return True

    def _set_periods(self, body: list[Fraction], state: list[Fraction]) -> None:
        """Complete integrals, the phase of the starting point and the mean rates."""
        ctx, curve = self.ctx, self.curve
        self.I1, self.I3, self.mgl = map(self._real, body)
        phi0, psi0, theta_dot = map(self._real, state[1:4])
        self.angles0 = (phi0 + self.facing * psi0, phi0 - self.facing * psi0)
        self.p_phi, self.p_psi = self.I1 * self.b, self.I1 * self.a
        self.drift = self.facing * self.a * (self.I1 / self.I3 - 1)
        self.m, self.m1 = +curve.m, +curve.m1
        self.K = ctx.elliprf(0, self.m1, 1) if self.m1 else ctx.inf
        self.K1 = ctx.elliprf(0, self.m, 1) if self.m else ctx.inf
        self.Omega = ctx.sqrt(curve.stiffness) / 2 if curve.stiffness > 0 else ctx.zero
        self.nutation_period = 2 * self.K / self.Omega if self.Omega else ctx.inf

        sign = -1 if self.facing * theta_dot > 0 else 1  # the sign of u'
        sn, cn = sign * ctx.sqrt(curve.start_sn2), ctx.sqrt(curve.start_cn2)
        self.tau0 = self._integral(None, sn, cn)
        self._complete = [self._integral(pole, ctx.one, ctx.zero) for pole in curve[:2]]  # 0 on the separatrix
        self._at_start = [self._integral(pole, sn, cn) for pole in curve[:2]]
        # Through a pole the half-angle sine is continued with its sign, positive at the start; cn >= 0 there.
        self.floor_sign = 1 if sn > 0 or (sn == 0 and theta_dot >= 0) else -1

        factors = [pole.twist / pole.low if pole.twist else ctx.zero for pole in curve[:2]]
        growth = [factor * integral / self.K for factor, integral in zip(factors, self._complete, strict=True)]
        self.mean_rates = (self.drift + growth[0], growth[1] - self.drift)  # of phi + psi and phi - psi
        self.lags0 = tuple(  # by how much they are ahead of their means at time 0, counted from a moment with u = u1
            (factor * first - self.tau0 * mean) / self.Omega if factor and self.Omega else ctx.zero
            for factor, first, mean in zip(factors, self._at_start, growth, strict=True)
        )
        self.phi_rate = (growth[0] + growth[1]) / 2
        self.psi_rate = self.facing * (self.drift + (growth[0] - growth[1]) / 2)
        self.phi_per_period, self.psi_per_period = (
            rate * self.nutation_period if rate else ctx.zero for rate in (self.phi_rate, self.psi_rate)
        )
        self.roots = tuple(sorted(self.facing * u for u in (curve.floor.low - 1, curve.floor.high - 1, curve.third)))
        ends = zip(curve.floor[1:], curve.crown[1:], strict=True)
        self.theta_range = tuple(sorted(self._theta(ctx.sqrt(down), ctx.sqrt(up)) for down, up in ends))

    def zero_heights(self) -> tuple[Any, Any]:
        """Imaginary parts in [0, K1] of the zeros i w (floor, 1 + u = 0) and K + i w (crown, 1 - u = 0)."""
        ctx, (floor, crown, swing, *_) = self.ctx, self.curve
        sn2, cn2 = floor.low / floor.high, swing / floor.high
        lower = ctx.sqrt(sn2) * ctx.elliprf(cn2, cn2 + self.m * sn2, 1)
        sn2, dn2 = crown.high / (self.m1 * crown.low), swing / crown.low
        return lower, ctx.sqrt(sn2) * ctx.elliprf(self.curve.beyond * dn2, dn2, 1)

    def __call__(self, time: Any) -> Motion[Any]:
        """Angles and rates at `time` (float, string, fraction or mpf), as `mpmath.mpf`."""
        down, up, total, difference, nod = self._state(time)
        phi, psi = (total + difference) / 2, self.facing * (total - difference) / 2
        halves = ((self.curve.floor.twist, down), (self.curve.crown.twist, up))
        phi_dot = sum((twist / (4 * half**2) for twist, half in halves if twist), self.ctx.zero)
        psi_dot = self.p_psi / self.I3 - self.facing * (down**2 - up**2) * phi_dot
        cosine, sine = (down, up) if self.facing > 0 else (up, down)
        if (cosine < 0) != (sine < 0):
            phi, psi, nod = phi + self.ctx.pi, psi + (self.ctx.pi if cosine < 0 else -self.ctx.pi), -nod
        motion = (self._theta(abs(down), abs(up)), phi, psi, self.facing * nod, phi_dot, psi_dot)
        return Motion(*map(_plain, motion))

    def axis(self, time: Any) -> tuple[Any, ...]:
        """Unit vector (x, y, z) along the top's axis."""
        down, up, total, difference, _ = self._state(time)
        sine, phi = 2 * down * up, (total + difference) / 2
        axis = (sine * self.ctx.sin(phi), -sine * self.ctx.cos(phi), self.facing * (down**2 - up**2))
        return tuple(map(_plain, axis))

    def quaternion(self, time: Any) -> tuple[Any, ...]:
        """Attitude (w, x, y, z), body to space, from the integrals of the third kind."""
        down, up, total, difference, _ = self._state(time)
        halves = down * self.ctx.expj(total / 2), up * self.ctx.expj(difference / 2)
        first, second = halves if self.facing > 0 else halves[::-1]
        return tuple(map(_plain, (first.real, second.real, second.imag, first.imag)))

    def _state(self, time: Any) -> tuple[Any, Any, Any, Any, Any]:
        """sqrt((1 + u)/2) and sqrt((1 - u)/2), signed, phi + psi, phi - psi and theta', all in the upright picture."""
        exact, last = rational("time", time), self._last
        if last is None or last[0] != exact:  # else a call for another quantity at the same time
            self._last = last = exact, self._state_after(self._real(exact))
        return last[1]

    def _state_after(self, elapsed: Any) -> tuple[Any, Any, Any, Any, Any]:
        ctx, curve = self.ctx, self.curve
        if curve.swing == 0:
            angles = [angle + rate * elapsed for angle, rate in zip(self.angles0, self.mean_rates, strict=True)]
            return ctx.sqrt(curve.floor.low / 2), ctx.sqrt(curve.crown.low / 2), angles[0], angles[1], ctx.zero
        tau = self.tau0 + self.Omega * elapsed
        if self.climbs:
            half, sech = self.floor_sign * ctx.tanh(tau), ctx.sech(tau)
            return half, sech, *self.angles0, -2 * self.Omega * self.floor_sign * sech
        turns = ctx.nint(tau / (2 * self.K))
        sn, cn, dn = self._jacobi(tau - 2 * turns * self.K)
        side = -1 if turns % 2 else 1
        angles, halves, ratios = [], [], []
        for i, (pole, drift, wave, sign, low, high) in enumerate((
            (curve.floor, self.drift, sn, side * self.floor_sign, curve.floor.low, curve.floor.high),
            (curve.crown, -self.drift, cn, side, curve.crown.high, curve.crown.low),
        )):  # fmt: skip
            integral = 2 * turns * self._complete[i] + self._integral(pole, sn, cn) - self._at_start[i]
            turn = pole.twist / pole.low * integral / self.Omega if pole.twist else 0
            angles.append(self.angles0[i] + drift * elapsed + turn)
            amplitude = sign * ctx.sqrt(high / 2)
            half = amplitude * wave if low == 0 else ctx.sqrt((pole.low * cn**2 + pole.high * sn**2) / 2)
            halves.append(half)
            ratios.append(1 / amplitude if low == 0 else wave / half)
        return *halves, *angles, -self.Omega * curve.swing * dn * ratios[0] * ratios[1]

    def _integral(self, pole: Pole | None, sn: Any, cn: Any) -> Any:
        """Pi(n; tau) of a pole (0 if its twist is 0), or tau itself, from sn and cn of tau; abs(tau) <= K."""
        ctx, c2 = self.ctx, cn**2
        if pole is not None and pole.twist == 0:
            return ctx.zero
        delta = self.m1 + self.m * c2
        first = sn * ctx.elliprf(c2, delta, 1)
        if pole is None:
            return first
        near = (pole.low * c2 + pole.high * sn**2) / pole.low
        return first + (1 - pole.high / pole.low) / 3 * sn**3 * ctx.elliprj(c2, delta, 1, near)

    def _jacobi(self, tau: Any) -> tuple[Any, Any, Any]:
        """sn, cn, dn for abs(tau) <= K, from the nearer of 0 and K: cn and dn keep their digits as m -> 1."""
        ctx, size = self.ctx, abs(tau)
        swap = size > self.K / 2
        mean, geometric, gap, ratios = ctx.one, ctx.sqrt(self.m1), ctx.sqrt(self.m), []
        while gap > mean * ctx.eps:  # the arithmetic-geometric mean, and the ratios c/a of its steps
            mean, geometric, gap = (mean + geometric) / 2, ctx.sqrt(mean * geometric), (mean - geometric) / 2
            ratios.append(gap / mean)
        angle = 2 ** len(ratios) * mean * (self.K - size if swap else size)
        for ratio in reversed(ratios):
            angle = (angle + ctx.asin(ratio * ctx.sin(angle))) / 2
        sn, cn = ctx.sin(angle), ctx.cos(angle)
        dn = ctx.sqrt(self.m1 + self.m * cn**2)
        if swap:
            sn, cn, dn = cn / dn, ctx.sqrt(self.m1) * sn / dn, ctx.sqrt(self.m1) / dn
        return (-sn if tau < 0 else sn), cn, dn

    def _theta(self, down: Any, up: Any) -> Any:
        return 2 * (self.ctx.atan2(up, down) if self.facing > 0 else self.ctx.atan2(down, up))

    def _real(self, value: Fraction) -> Any:
        return self.ctx.mpf(value.numerator) / value.denominator


def _plain(value: Any) -> Any:
    """The same number as an ordinary `mpmath.mpf`."""
    from mpmath import mp

    return mp.make_mpf(value._mpf_)


DIGITS = 40

# sin((2n+1)x)/sin x, cos((2n+1)x)/cos x, cos 2nx and sin 2nx/(sin x cos x) in powers of cos 2x
_SINES = ((1, 0, 0, 0), (1, 2, 0, 0), (-1, 2, 4, 0), (-1, -4, 4, 8))
_COSINES = ((1, 0, 0, 0), (-1, 2, 0, 0), (-1, -2, 4, 0), (1, -4, -4, 8))
_EVEN_COSINES = ((1, 0, 0, 0), (0, 1, 0, 0), (-1, 0, 2, 0), (0, -3, 0, 4))
_EVEN_SINES = ((0, 0, 0, 0), (2, 0, 0, 0), (0, 4, 0, 0), (-2, 0, 8, 0))


def precise_constants(top: SymmetricTop, start: Angles, form: PreciseForm | None = None) -> Array:
    """The array of constants, from `form` or, without one, from a form of `DIGITS` digits.

    Raises `SymtopError` if the axis comes within 1e-145 of a pole that it does not meet, or never leaves that range.
    """
    form, out = form or PreciseForm(top, start, digits=DIGITS), np.zeros(at.SIZE)
    ctx, curve = form.ctx, form.curve
    out[at.ARITHMETIC], out[at.UPRIGHT], out[at.I1] = at.DIGITS, form.facing > 0, top.I1
    out[at.P_PSI], out[at.W3] = float(form.p_psi), float(form.p_psi / form.I3)
    out[at.ENERGY], out[at.P_PHI] = float(form.energy), float(form.p_phi)
    out[at.PERIOD], out[[at.THETA_LOW, at.THETA_HIGH]] = float(form.nutation_period), [*map(float, form.theta_range)]
    out[at.PHI_PER_PERIOD], out[at.PSI_PER_PERIOD] = float(form.phi_per_period), float(form.psi_per_period)
    if form.climbs:
        out[at.KIND], out[at.SCALE], out[at.FLOOR_SIGN] = at.CLIMBS, float(form.Omega), float(form.floor_sign)
    elif curve.swing:
        if any(0 < gap < 1e-290 for gap in (*curve.floor[1:], *curve.crown[1:], curve.m1)):
            words = "the axis must meet a pole or miss it by 1e-145, and leave it by as much (PreciseForm takes less)"
            raise SymtopError(f"{words}, not as {start!r}")
        _expand(form, out)
    else:
        values = (ctx.sqrt(curve.floor.low / 2), ctx.sqrt(curve.crown.low / 2), form.phi_rate)
        out[[at.REST_DOWN, at.REST_UP, at.REST_RATE]] = [float(value) for value in values]

    starts = [(angle - lag) / 2 for angle, lag in zip(form.angles0, form.lags0, strict=True)]
    phi0, psi0 = sum(starts), form.facing * (starts[0] - starts[1])
    turn = 2 * ctx.pi
    _put_line(out, at.PHI_LINE, form.phi_rate, phi0)
    _put_line(out, at.PSI_LINE, form.psi_rate, psi0)
    rates = form.phi_rate, form.mean_rates[0] / 2, form.mean_rates[1] / 2
    for place, rate, angle in zip((at.PHI_TURNS, at.DOWN_TURNS, at.UP_TURNS), rates, (phi0, *starts), strict=True):
        _put_line(out, place, rate / turn, angle / turn - ctx.nint(angle / turn))
    return out


def _expand(form: PreciseForm, out: Array) -> None:
    """Coefficients about the turning points u1 (near the floor) and u2 (near the crown), scaled to moduli of 1."""
    ctx, curve, hyperbolic = form.ctx, form.curve, bool(form.m > 0.5)
    signs = [float(ctx.sign(pole.twist)) for pole in curve[:2]]
    out[at.KIND], out[at.HYPERBOLIC], out[at.FLOOR_SIGN] = at.MOVES, hyperbolic, float(form.floor_sign)
    out[at.SIGN_DOWN], out[at.SIGN_UP], out[at.MAY_STOP] = *signs, signs[0] * signs[1] < 0.0
    out[at.TWIST_DOWN], out[at.TWIST_UP] = (float(ctx.sqrt(abs(pole.twist)) / 2) for pole in curve[:2])
    _put_line(out, at.QUARTERS, form.Omega / form.K, form.tau0 / form.K)
    period, other_period = (form.K1, form.K) if hyperbolic else (form.K, form.K1)
    nome = ctx.exp(-ctx.pi * other_period / period) if form.m else ctx.zero
    heights = [ctx.pi * height / (2 * period) for height in form.zero_heights()]
    halves = [(_hyperbolic_halves if hyperbolic else _trigonometric_halves)(ctx, y, nome) for y in heights]
    growths = [float(ctx.pi / 2 - (y if hyperbolic else 0)) for y in heights]
    scale, bend = ctx.pi * form.K / (2 * period), _series(_SINES, _weights(ctx, nome))
    out[at.SCALE] = float(scale)
    _put(out, at.BEND, bend, 1)
    floor, crown = curve.floor, curve.crown
    for near, frame, side, near_gap, far_gap, factor in (
        (0, at.FLOOR, 1, floor.low, crown.low, 1),
        (1, at.CROWN, -1, crown.high, floor.high, form.m1),
    ):
        near_real, near_imag, _, _ = halves[near]
        _, _, far_real, far_imag = halves[1 - near]
        depth = curve.swing * factor * (form.K / scale) ** 2  # abs(u - u_near) = depth angle^2
        near_unit = ctx.sqrt(near_gap / 2) / sum(near_real) if near_gap else ctx.sqrt(depth / 2) / sum(near_imag)
        far_unit = ctx.sqrt(far_gap / 2) / sum(far_real)
        _put(out, frame + at.NEAR_REAL, near_real, near_unit)
        _put(out, frame + at.NEAR_IMAG, near_imag, near_unit)
        _put(out, frame + at.FAR_REAL, far_real, far_unit)
        _put(out, frame + at.FAR_IMAG, far_imag, far_unit)
        out[frame + at.NEAR_GROWTH], out[frame + at.FAR_GROWTH] = growths[near], growths[1 - near]
        out[frame + at.STEEPNESS] = float(-side * form.Omega * depth * scale / form.K / sum(bend))
        out[frame + at.LEAN] = float((floor.twist * crown[1 + near] + crown.twist * floor[1 + near]) / 2)  # b - a u
        out[frame + at.LEANING] = float(-side * form.facing * form.a * depth / sum(bend) ** 2)
        out[frame + at.THROUGH] = near_gap == 0


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
