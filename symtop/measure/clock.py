"""The phase of the nutation: how far a run is ahead of the truth or behind it.

The true (u, u'), u = cos(theta), runs round a closed curve once a nutation. A state of a run, on that curve or near it,
has the phase of the point of the curve that lies in its direction from the middle:

    phase(state) = 2 pi t*/T,   t* the time at which the truth is in that direction,   error = phase(state) - 2 pi t/T

and t* as a function of the angle is a periodic spline through `NODES` true states (error below 1e-11). The error is
unwrapped from sample to sample. An error of the amplitude alone leaves the phase on average as it is.
"""

import math

import numpy as np

from symtop.base.validate import SymtopError
from symtop.model.scenes import Scene, closed_form

NODES = 4096
NARROWEST = 1e-6  # rad: a nutation narrower than this has no phase to speak of


def has_phase(scene: Scene) -> bool:
    """Does this motion nutate, with a finite period?"""
    highest, lowest = closed_form(scene).theta_range
    return lowest - highest > NARROWEST and math.isfinite(scene.nutation_period)


class Clock:
    """The phase of the nutation of a scene as a function of (theta, theta')."""

    def __init__(self, scene: Scene) -> None:
        from scipy.interpolate import CubicSpline  # 0.3 s to import

        self.period = scene.nutation_period
        exact = closed_form(scene)
        if not has_phase(scene):
            raise SymtopError(f"scene {scene.name} has no nutation whose phase could be measured")
        times = self.period * np.arange(NODES + 1) / NODES
        motion = exact(times)
        u, v = np.cos(motion.theta), -np.sin(motion.theta) * motion.theta_dot
        self._centre, self._width = 0.5 * (u.max() + u.min()), 0.5 * (u.max() - u.min())
        self._height = np.abs(v).max()
        angle = np.unwrap(self._angle(u, v))
        self._sign = 1.0 if angle[-1] > angle[0] else -1.0
        first = angle[0] * self._sign
        turn = angle * self._sign
        turn[-1] = first + 2.0 * math.pi
        lag = 2.0 * math.pi * times / self.period - (turn - first)
        lag[-1] = lag[0]
        self._first, self._lag = first, CubicSpline(turn, lag, bc_type="periodic")

    def _angle(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.asarray(np.arctan2(v / self._height, (u - self._centre) / self._width))

    def error(self, time: np.ndarray, theta: np.ndarray, theta_dot: np.ndarray) -> np.ndarray:
        """Phase of states less that of the truth at the same times (samples,), rad, unwrapped; NaN stays."""
        turn = self._sign * self._angle(np.cos(theta), -np.sin(theta) * theta_dot)
        phase = (turn - self._first) + self._lag(turn)
        ahead = phase - 2.0 * math.pi * np.mod(time / self.period, 1.0)
        good = np.isfinite(ahead)
        start = math.remainder(float(ahead[good][0]), 2.0 * math.pi) - float(ahead[good][0]) if good.any() else 0.0
        ahead[good] = np.unwrap(ahead[good]) + start
        return np.asarray(ahead)
