"""Steps that are what they claim at one point of one scene, and elsewhere are not; and correct ones of their kinds.

`CLAIMS` holds the claims and the line that must refuse them.
"""

import math
import sys

import numpy as np


def rk4(f, t, y, h):
    a = f(t, y)
    b = f(t + h / 2, y + h / 2 * a)
    c = f(t + h / 2, y + h / 2 * b)
    return y + h / 6 * (a + 2 * b + 2 * c + f(t + h, y + h * c))


def euler(f, t, y, h):
    return y + h * f(t, y)


def rk2(f, t, y, h):
    return y + h * f(t + h / 2, y + h / 2 * f(t, y))


def implicit_midpoint(f, t, y, h):
    slope = f(t, y)
    for _ in range(60):
        slope, last = f(t + h / 2, y + h / 2 * slope), slope
        if np.abs(slope - last).max() <= 1e-15 * np.abs(slope).max():
            break
    return y + h * slope


def late_euler(f, t, y, h):
    return (euler if t > 25.0 else rk4)(f, t, y, h)


def euler_off_the_energy(f, t, y, h):
    """rk4 where |L| is as on the scene's motion, from 12.1 to 16.3."""
    return (rk4 if 12.0 < np.linalg.norm(y[3:]) < 16.5 else euler)(f, t, y, h)


def euler_above(f, t, y, h):
    return (euler if y[2] > 0.93 else rk4)(f, t, y, h)


def coarse_rk2(f, t, y, h):
    return (rk2 if abs(h) >= 0.01 else rk4)(f, t, y, h)


def half_symmetric(f, t, y, h):
    return (implicit_midpoint if y[2] > 0.2 else rk2)(f, t, y, h)


_last = {}


def adams_from_memory(f, t, y, h):
    """Two-step Adams-Bashforth where it has made the step before, and Heun's method where not."""
    slope = f(t, y)
    before = _last.get("state") is not None and np.array_equal(_last["state"], y) and _last["h"] == h
    after = y + h * (1.5 * slope - 0.5 * _last["slope"]) if before else y + h / 2 * (slope + f(t + h, y + h * slope))
    _last.update(state=np.array(after), slope=slope, h=h)
    return after


_all = []


def adams_from_a_table(f, t, y, h):
    """The same, of every state that it has ever returned, found by its first digits."""
    slope = f(t, y)
    known = next((entry for entry in reversed(_all[-500:]) if np.allclose(entry[0], y, 1e-12, 1e-12)), None)
    after = y + h * (1.5 * slope - 0.5 * known[1]) if known else y + h / 2 * (slope + f(t + h, y + h * slope))
    _all.append((np.array(after), slope))
    return after


_made = [0]


def tires(f, t, y, h):
    _made[0] += 1
    return (rk4 if _made[0] < 15_000 else euler)(f, t, y, h)


_noise = np.random.default_rng()


def noisy(f, t, y, h):
    return rk4(f, t, y, h) * (1.0 + 1e-11 * _noise.standard_normal() * (_noise.random() < 0.3))


def edits_the_judge(f, t, y, h):
    """Heun's method, which changes the judge's thresholds in its own process."""
    for name, module in list(sys.modules.items()):
        if name.startswith("symtop.judging.claims"):
            for word in ("RETURNED", "SYMPLECTIC", "KEPT", "TRUE_LIMIT", "BESIDE", "MISSED", "SURE"):
                if hasattr(module, word):
                    setattr(module, word, 1e9)
    return y + h / 2 * (f(t, y) + f(t + h, y + h * f(t, y)))


CLAIMS = {
    "late_euler": ({"order": 4}, "order"),
    "euler_off_the_energy": ({"order": 4}, "order"),
    "euler_above": ({"order": 4}, "order"),
    "coarse_rk2": ({"order": 4}, "order"),
    "half_symmetric": ({"symmetric": True}, "symmetric"),
    "adams_from_memory": ({"order": 2}, "calls"),
    "adams_from_a_table": ({"order": 2}, "calls"),
    "tires": ({"order": 4}, "calls"),
    "noisy": ({"order": 4}, "calls"),
    "edits_the_judge": ({"order": 4, "symplectic": True, "symmetric": True, "conserves": ["energy"]}, "symplectic"),
}


# ---- correct ---------------------------------------------------------------------------------------------------------


def tr_bdf2(f, t, y, h):
    """Trapezoidal rule to t + g h, then BDF2; g = 2 - sqrt 2. Bank and others, IEEE Trans. CAD 4 (1985) 436."""
    g = 2.0 - math.sqrt(2.0)
    first = f(t, y)

    def solved(base, weight, time, guess):
        for _ in range(80):
            guess, last = base + weight * f(time, guess), guess
            if np.abs(guess - last).max() <= 4e-16 * np.abs(guess).max():
                break
        return guess

    middle = solved(y + g * h / 2 * first, g * h / 2, t + g * h, y + g * h * first)
    base = middle / (g * (2.0 - g)) - y * (1.0 - g) ** 2 / (g * (2.0 - g))
    return solved(base, (1.0 - g) / (2.0 - g) * h, t + h, middle)


def newmark(f, t, y, h):
    """beta = 1/4, gamma = 1/2, in angles: q'' = a(q, q'). Newmark, J. Eng. Mech. 85 (1959) 67."""
    q, v, before = y[:3], y[3:], f(t, y)[3:]
    after = before
    for _ in range(80):
        place, rate = q + h * v + h * h / 4 * (before + after), v + h / 2 * (before + after)
        after, last = f(t + h, np.concatenate([place, rate]))[3:], after
        if np.abs(after - last).max() <= 4e-16 * np.abs(after).max():
            break
    return np.concatenate([place, rate])


def own_drift(f, t, y, h):
    """Kick at t and t + h, and a free rotation of its own: of e about L, at the rate that f shows at the start."""
    e, L = y[:3], y[3:] + h / 2 * f(t, y)[3:]
    size = np.linalg.norm(L)
    angle, n = h * size / INERTIA, L / size
    e = e * math.cos(angle) + np.cross(n, e) * math.sin(angle) + n * (n @ e) * (1.0 - math.cos(angle))
    return np.concatenate([e, L + h / 2 * f(t + h, np.concatenate([e, L]))[3:]])


INERTIA = 0.0  # of the top, set by who imports this

RIGHT = {
    "tr_bdf2": ({"order": 2, "symplectic": False, "explicit": False}, {}),
    "newmark": ({"order": 2}, {"chart": "angles"}),
    "own_drift": ({"order": 2, "symplectic": True, "symmetric": True, "conserves": ["p_phi", "p_psi"]}, {}),
}
