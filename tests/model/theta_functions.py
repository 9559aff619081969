"""The attitude of the closed form by theta functions: a second derivation, for tests of the first."""


def theta_quaternion(form, time):
    """Attitude (w, x, y, z) of a `PreciseForm` by theta functions, without branches, as Klein and Sommerfeld write it.

    With z = pi tau/2K and the pole at z = z0 (floor i y, crown pi/2 + i y; y has the sign of the twist), the halves
    are ``sqrt(d/2) exp(i angle/2) = C exp(i rate tau) theta_1(z - z0)/theta_4(z)``. C and the rate follow from the
    value and derivative at the turning point far from the pole. Only roots and phase are shared with `quaternion`.
    """
    if form.curve.swing == 0:
        return form.quaternion(time)
    ctx, (floor, crown, *_, start_sn2, start_cn2) = form.ctx, form.curve
    scale, quarter, heights = ctx.pi / (2 * form.K), ctx.pi / 2, form.zero_heights()
    nome = ctx.exp(-ctx.pi * form.K1 / form.K) if form.m else ctx.zero
    passed = form.Omega * form.ctx.mpf(time)
    start, now = scale * form.tau0, scale * (form.tau0 + passed)
    halves = []
    for pole, height, angle, drift, distance, far, on_pole in (
        (floor, heights[0], form.angles0[0], form.drift, floor.high, quarter, floor.low == start_sn2 == 0),
        (crown, heights[1], form.angles0[1], -form.drift, crown.low, 0, crown.high == start_cn2 == 0),
    ):
        zero = ctx.mpc(quarter - far, (-1 if pole.twist < 0 else 1) * scale * height)
        value, derivative = _theta_series(ctx, 1, far - zero, nome)
        turning = (drift + pole.twist / distance) / (2 * form.Omega) - scale * ctx.im(derivative / value)
        size = ctx.sqrt(distance / 2) * _theta_series(ctx, 4, far, nome)[0] / abs(value)
        begin = _theta_series(ctx, 1, start - zero, nome)[0]
        if on_pole:  # continue towards theta'
            begin = ctx.mpc(form.floor_sign if far else -1)
        wave = _theta_series(ctx, 1, now - zero, nome)[0] / _theta_series(ctx, 4, now, nome)[0]
        halves.append(size * ctx.expj(angle / 2 - ctx.arg(begin) + turning * passed) * wave)
    first, second = halves if form.facing > 0 else halves[::-1]
    return first.real, second.real, second.imag, first.imag


def _theta_series(ctx, kind, z, nome):
    """theta_1(z) without its factor 2 q^(1/4), or theta_4(z), and the derivative; nome q in [0, 1)."""
    value, derivative = (ctx.sin(z), ctx.cos(z)) if kind == 1 else (ctx.one, ctx.zero)
    growth, n, weight = 2 * abs(ctx.im(z)), 0, ctx.one
    while abs(weight) * ctx.exp((n + 1) * growth) * (2 * n + 2) > ctx.eps:
        n += 1
        weight = (-1) ** n * (nome ** (n * (n + 1)) if kind == 1 else 2 * nome ** (n * n))
        k = 2 * n + 1 if kind == 1 else 2 * n
        sine, cosine = ctx.sin(k * z), ctx.cos(k * z)
        value += weight * (sine if kind == 1 else cosine)
        derivative += weight * k * (cosine if kind == 1 else -sine)
    return value, derivative
