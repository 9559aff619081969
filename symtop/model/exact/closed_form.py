"""Closed-form motion of the heavy symmetric top, of one (`ClosedForm`) or of many (`ClosedForms`).

The attitude is written in the two complex half-angle functions of Klein and Sommerfeld,

    A = cos(theta/2) exp(i (phi + psi)/2),        B = sin(theta/2) exp(i (phi - psi)/2),

which are quotients theta_k(z - i y)/theta_4(z), z = pi tau/2K, times an exponential. theta_4 is common to both and
cancels in every angle. About each turning point, at x quarter periods from it, one function belongs to the pole that
the axis is near and one to the pole that it is far from; up to a common real factor, with cubics P in C,

    m <= 1/2    near, far = cos z P + i sin z P,                       z = pi x/2,      C = cos 2z,   nome exp(-pi K'/K)
    m >  1/2    near = cosh s P + i sinh s P, far = P + i sinh 2s P,   s = pi K x/2K',  C = cosh 2s,  nome exp(-pi K/K')

The second line is Jacobi's imaginary transformation. The nome is at most exp(-pi) = 0.043 either way: the first dropped
term is below 1e-19, and m -> 1 is no special case. As abs(x) <= 1/2, everything is relatively accurate at both turning
points, however closely the axis grazes a pole there. Then

    theta = 2 atan2(abs B, abs A),        (phi +- psi)/2 = mean rate t + (argument - its mean growth) + const,
    theta' sin theta = const theta_1(2z)/theta_4(z)^4,        u - u1, u2 - u = const theta_k(z)^2/theta_4(z)^2.

The phase and the secular angles are products of t with rates of two doubles, so that the error of theta does not grow
with time, and that of phi and psi only as their last digit does. Nothing is expanded in the amplitude. Constants:
`symtop.model.exact.constants`, and in 40 digits `symtop.model.exact.digits`; evaluation: `symtop.model.exact.samples`.
Sources: Klein and Sommerfeld, Theory of the Top, chapter 6; Whittaker and Watson, A Course of Modern Analysis, 21.

Both classes loop over their members with the same compiled functions, so that a member has the bits of its own closed
form; the functions release the interpreter's lock, and threads may share the work.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symtop.core.errors import SymtopError
from symtop.core.numbers import real_numbers
from symtop.model.charts import Array
from symtop.model.exact import layout as at, samples
from symtop.model.exact.constants import DONE, OUT_OF_RANGE, UNMET, UNRESOLVED, all_constants
from symtop.model.exact.digits import Motion, precise_constants
from symtop.model.lazy_kernel import LazyKernel
from symtop.model.top import LARGEST, MOMENT_SLACK, NUMBERS, Angles, SymmetricTop, flat

ARITHMETIC = ("double", "double-double", "quad-double", "40 digits")  # by `layout.EXACTLY`, `layout.DOUBLE_DOUBLE`, ...
REASONS = {
    DONE: "",
    OUT_OF_RANGE: "the data or the turning points leave the range in which squares of doubles keep their digits",
    UNRESOLVED: "quad-double does not tell the turning points apart",
    UNMET: "the constants do not give the start",
}
DIGITS_ERROR = 1e-40  # relative, of constants from 40 digits

# seconds: interpreted, a form 5e-4 and a sample 1e-5; compiling 10 s and 2 s of processor time, loading 0.3 s; who
# makes 5000 forms makes them again in another process, so that there is less patience than compiling takes
_build = LazyKernel(all_constants, "(float64[:, ::1], float64[:, ::1])", patience=2.5)
_fill = LazyKernel(samples.all_samples, "(float64[:, ::1], float64[:, ::1], int64, float64[:, :, ::1])", patience=2.0)
_compare = LazyKernel(
    samples.all_gaps, "(float64[:, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, ::1])", patience=2.0
)
FORM_SECONDS, SAMPLE_SECONDS = 5e-4, 1e-5


class Provenance(NamedTuple):
    """How the constants of a closed form were computed."""

    arithmetic: str  # "double-double", "quad-double", "40 digits", or "double" on the separatrix
    rate_error: float  # bound of the relative error of the rates that a phase grows with
    reason: str  # why 40 digits were needed, or empty


def _constant(place: int, words: str) -> property:
    return property(lambda form: form._constant(place), doc=words)


class _Form:
    """Constants and views of the motion; shapes are those of a `ClosedForm`, with the member first in `ClosedForms`."""

    energy = _constant(at.ENERGY, "Total energy, p_psi^2/2 I3 included.")
    p_phi = _constant(at.P_PHI, "Momentum conjugate to phi.")
    p_psi = _constant(at.P_PSI, "Momentum conjugate to psi.")
    nutation_period = _constant(
        at.PERIOD, "Time from one turning point of a kind to the next; infinite without a next."
    )
    phi_per_period = _constant(at.PHI_PER_PERIOD, "Mean precession in a nutation period, radians.")
    psi_per_period = _constant(at.PSI_PER_PERIOD, "Mean growth of psi in a nutation period, radians.")
    precession_rate = _constant(at.PHI_LINE, "Mean of phi' over a nutation, radians per unit time.")

    _view: Callable[[ArrayLike, int], Array]  # a view in the shapes of the class, and of `ROWS` with the rows first

    def __call__(self, times: ArrayLike) -> Motion[Array]:
        """Angles and rates at `times`; every field has their shape, or (n, samples)."""
        return Motion(*self._view(times, samples.MOTION))

    def turns(self, times: ArrayLike) -> Array:
        """phi and psi alone, (2, ...), with the bits of a call."""
        return self._view(times, samples.TURNS)

    def quaternion(self, times: ArrayLike) -> Array:
        """Attitude (w, x, y, z), body to space, shape (..., 4); continuous in time, through poles as well."""
        return self._view(times, samples.QUATERNION)

    def axis(self, times: ArrayLike) -> Array:
        """Unit vector along the top's axis, shape (..., 3)."""
        return self._view(times, samples.AXIS)

    def momentum(self, times: ArrayLike) -> Array:
        """Angular momentum L in the space frame, shape (..., 3), in units of I1 times a rate."""
        return self._view(times, samples.MOMENTUM)

    def state(self, times: ArrayLike) -> Array:
        """Quaternion and angular momentum, shape (..., 7): a state of the attitude chart."""
        return self._view(times, samples.STATE)


class ClosedForm(_Form):
    """Closed-form motion of `top` from `start` at time 0, all numbers read as exact doubles.

    Errors, measured against 50 digits for times up to 1e6: theta 1e-15; phi and psi one unit in the last place plus
    1e-15; axis and quaternion 1e-15. Methods take times of any shape and raise `SymtopError` for any that is not
    finite; so does construction if the axis comes within 1e-145 of a pole that it does not meet.

    The constants are double-double numbers. Where an error bound is too large, they are computed from quad-double sums,
    and where it is still too large, with 40 digits: see `provenance`.

    `nutation_period` is that of small nutations for a steady precession, and infinite where the axis stands on an
    unstable pole or climbs to it for ever; `phi_per_period`, `psi_per_period` are the mean growth over it (0 if the
    mean rate is 0) and `theta_range` the two turning points, radians.

    Where the axis passes exactly through a pole, theta' changes sign, and phi and psi jump by pi there and back in
    turn. On a pole only phi + psi (phi - psi at pi) has a meaning.
    """

    def __init__(self, top: SymmetricTop, start: Angles) -> None:
        if not isinstance(top, SymmetricTop) or not isinstance(start, Angles):
            kinds = f"{type(top).__name__} and {type(start).__name__}"
            raise SymtopError(f"top and start must be a SymmetricTop and Angles, not {kinds}")
        self.top, self.start = top, start
        self._all, failed = short_constants(np.array((flat(top, start),)))
        self._constants = self._all[0]
        if failed:
            take_digits(self._constants, top, start)

    @property
    def provenance(self) -> Provenance:
        """The arithmetic of the constants, the bound of their error, and why a shorter arithmetic was not enough."""
        kind = int(self._constants[at.ARITHMETIC])
        error = DIGITS_ERROR if kind == at.DIGITS else float(self._constants[at.RATE_ERROR])
        return Provenance(ARITHMETIC[kind], error, REASONS[int(self._constants[at.STATUS])])

    @property
    def theta_range(self) -> tuple[float, float]:
        """The turning points, radians."""
        return float(self._constants[at.THETA_LOW]), float(self._constants[at.THETA_HIGH])

    def axis_distance(self, times: Array, axes: Array) -> Array:
        """Angles between axes (n, 3) and the top's at times (n,), rad, shape (n,)."""
        return np.asarray(distances(self._all, _as_row(times)[0], axes[None])[0])

    def run(self, times: Array) -> tuple[Array, Array, Array]:
        """States (n, 7) at a row of times, with p_phi = L_z and p_psi = L.e read off them."""
        values = self._view(times, samples.RUN)
        return values[:, :7], values[:, 7], values[:, 8]

    def _constant(self, place: int) -> float:
        return float(self._constants[place])

    def _view(self, times: ArrayLike, view: int) -> Array:
        flat_times, shape = _as_row(times)
        width = (samples.WIDTHS[view],)
        return fill(self._all, flat_times, view).reshape(width + shape if view in samples.ROWS else shape + width)


def compile_now() -> None:
    """Load the compiled functions, or compile them: call it before timing a closed form or making many."""
    for kernel in (_build, _fill, _compare):
        kernel.compile()


def load() -> bool:
    """Load the compiled functions that are in the cache; returns whether all are loaded now."""
    loaded = [kernel.load() for kernel in (_build, _fill, _compare)]
    return all(loaded)


def short_constants(rows: Array) -> tuple[Array, int]:
    """Constants (n, SIZE) of tops and starts (n, 9) without 40 digits, and for how many rows they are too inexact."""
    if _build.ready(FORM_SECONDS * len(rows)):
        out = np.empty((len(rows), at.SIZE))
        return out, _build.compiled(rows, out)
    lists = [[0.0] * at.SIZE for _ in rows]
    failed = all_constants(rows.tolist(), lists)
    return np.array(lists).reshape(len(rows), at.SIZE), failed


def take_digits(constants: Array, top: SymmetricTop, start: Angles) -> None:
    """Replace constants that are too inexact by those from 40 digits; their status stays."""
    status = constants[at.STATUS]
    constants[:] = precise_constants(top, start)
    constants[at.STATUS] = status


def fill(constants: Array, times: Array, view: int) -> Array:
    """One view of n tops at times (n, samples) or (1, samples): (n, samples, width), or (n, width, samples) of `ROWS`.

    Raises `SymtopError` for a time that is not finite.
    """
    count, width = times.shape[1], samples.WIDTHS[view]
    out = np.empty((len(constants), width, count) if view in samples.ROWS else (len(constants), count, width))
    _put(_fill, SAMPLE_SECONDS * len(constants) * count, constants, times, view, out)
    return out


def distances(constants: Array, times: Array, axes: Array) -> Array:
    """Angles (n, samples) between axes (n, samples, 3) and those of n tops, rad; times as in `fill`."""
    out = np.empty(axes.shape[:2])
    _put(_compare, SAMPLE_SECONDS * axes.size / 3, constants, times, np.ascontiguousarray(axes), out)
    return out


def _put(kernel: LazyKernel, seconds: float, constants: Array, times: Array, *others: Any) -> None:
    """Let a kernel fill in the last argument (`seconds` if interpreted); SymtopError for a time out of range."""
    if kernel.ready(seconds):
        index = kernel.compiled(constants, times, *others)
    else:
        index = kernel.py_func(constants.tolist(), times.tolist(), *others)
    if index >= 0:
        words = f"times must be finite numbers of at most {samples.LONGEST_TIME:g} in size"
        raise SymtopError(f"{words}, not {float(times.flat[index])!r}")


def _as_row(times: ArrayLike) -> tuple[Array, tuple[int, ...]]:
    """Times in a row (1, n) that compiled code takes, and their shape."""
    array = real_numbers("times", times)
    row = array.reshape(1, -1)
    return (row if row.flags.writeable else row.copy()), array.shape


class ClosedForms(_Form):
    """Closed-form motions of n tops from rows (n, 9) of `NUMBERS`, as `symtop.model.top.flat` puts them together.

    What `ClosedForm` has of a top is an array here, the first dimension the member. Times are a row for all members or
    an array (n, samples). `constants` are laid out as in `symtop.model.exact.layout`. A member whose axis comes so
    close to a pole that no form in doubles exists is NaN, and `refused` holds the reason. Raises `SymtopError` for a
    row that is no top or no start.
    """

    def __init__(self, numbers: ArrayLike) -> None:
        self.numbers = checked_numbers(numbers)
        self.refused: dict[int, str] = {}
        self.constants, failed = short_constants(self.numbers)
        if failed:
            for member in np.flatnonzero(self.constants[:, at.STATUS] != DONE).tolist():
                row = self.numbers[member].tolist()
                try:
                    take_digits(self.constants[member], SymmetricTop(*row[:3]), Angles(*row[3:]))
                except SymtopError as error:
                    self.refused[member] = str(error)
                    self.constants[member] = np.nan

    def __len__(self) -> int:
        return len(self.numbers)

    @cached_property
    def arithmetic(self) -> list[str]:
        """The arithmetic of the constants of each member; empty if the member was refused."""
        return [ARITHMETIC[int(kind)] if kind >= 0.0 else "" for kind in self.constants[:, at.ARITHMETIC].tolist()]

    @property
    def theta_range(self) -> Array:
        """The turning points, radians, shape (n, 2)."""
        return self.constants[:, [at.THETA_LOW, at.THETA_HIGH]]

    def run(self, times: ArrayLike) -> tuple[Array, Array]:
        """States (n, samples, 7), and p_phi = L_z and p_psi = L.e read off them, (n, samples, 2)."""
        values = self._view(times, samples.RUN)
        return values[..., :7], values[..., 7:]

    def _constant(self, place: int) -> Array:
        return self.constants[:, place]

    def _view(self, times: ArrayLike, view: int) -> Array:
        array = real_numbers("times", times)
        rows = np.atleast_2d(array)
        if rows.ndim != 2 or (len(rows) != len(self) and array.ndim != 1):
            words = f"times must be a row for all members or have the shape ({len(self)}, samples)"
            raise SymtopError(f"{words}, not {array.shape}")
        values = fill(self.constants, rows if rows.flags.writeable else rows.copy(), view)
        return values.swapaxes(0, 1) if view in samples.ROWS else values


def checked_numbers(numbers: ArrayLike, names: Any = None) -> Array:
    """The rows as compiled code takes them; SymtopError names the first member that is no top or no start."""
    rows = real_numbers("numbers", numbers)
    rows = rows if rows.flags.writeable else rows.copy()  # compiled code takes no other
    if rows.ndim != 2 or rows.shape[1] != len(NUMBERS):
        raise SymtopError(f"numbers must have the shape (n, 9), with {', '.join(NUMBERS)}, not {rows.shape}")
    inertia, theta = rows[:, :2], rows[:, 3]
    valid = ((rows <= LARGEST) & (rows >= -LARGEST)).all(axis=1) & (inertia >= 1.0 / LARGEST).all(axis=1)
    with np.errstate(over="ignore"):  # of rows that are refused anyway
        fits = rows[:, 1] <= 2.0 * rows[:, 0] * (1.0 + MOMENT_SLACK)
    valid &= fits & (theta >= 0.0) & (theta <= np.pi)
    for member in np.flatnonzero(~valid).tolist():
        row = rows[member].tolist()
        try:
            SymmetricTop(*row[:3]), Angles(*row[3:])
        except SymtopError as error:
            raise SymtopError(f"member {member if names is None else names[member]}: {error}") from None
    return rows
