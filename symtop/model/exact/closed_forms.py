"""Closed-form motion of many tops: their constants in one compiled call, their samples in another.

Both calls loop over the members with the functions that `ClosedForm` calls for one, so that a member has the bits of
its own closed form; they hold no lock of the interpreter and write to arrays of their own, so that threads may share
the work and the forms. Costs, compiled: 3 to 6 microseconds a member and 0.1 microseconds a sample. The few members
that need 40 digits follow one by one, 15 milliseconds each.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symtop.core.errors import SymtopError
from symtop.core.numbers import real_numbers
from symtop.model.charts import Array
from symtop.model.exact import motion_layout as at
from symtop.model.exact.closed_form import ARITHMETIC, fill, short_constants, take_digits
from symtop.model.exact.motion_samples import AXIS, MOMENTUM, MOTION, QUATERNION, RUN, STATE, TURNS
from symtop.model.exact.moving_axis import DONE
from symtop.model.exact.precise_form import Motion
from symtop.model.top import LARGEST, Angles, SymmetricTop

NUMBERS = ("I1", "I3", "mgl", "theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot")


class ClosedForms:
    """Closed-form motions of n tops from rows (n, 9) of `NUMBERS`, as `symtop.model.top.flat` puts them together.

    What `ClosedForm` says of a top is an array here, the first dimension the member. Times are a row for all members or
    an array (n, samples). `constants` are laid out as `symtop.model.exact.motion_layout` says. `refused` holds the
    reason of each member whose axis comes so close to a pole that no form in doubles exists; what is asked of it is
    NaN. Raises `SymtopError` for a row that is no top or no start.
    """

    def __init__(self, numbers: ArrayLike) -> None:
        self.numbers = checked(numbers)
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
        """The arithmetic that served for the constants of each member; empty if it was refused."""
        return [ARITHMETIC.get(kind, "") for kind in self.constants[:, at.ARITHMETIC].tolist()]

    @property
    def energy(self) -> Array:
        """Total energies, shape (n,)."""
        return self.constants[:, at.ENERGY]

    @property
    def p_phi(self) -> Array:
        """Momenta conjugate to phi, shape (n,)."""
        return self.constants[:, at.P_PHI]

    @property
    def p_psi(self) -> Array:
        """Momenta conjugate to psi, shape (n,)."""
        return self.constants[:, at.P_PSI]

    @property
    def nutation_period(self) -> Array:
        """Time from one turning point of a kind to the next, shape (n,); infinite where there is no next."""
        return self.constants[:, at.PERIOD]

    @property
    def precession_rate(self) -> Array:
        """Mean of phi' over a nutation, radians per unit time, shape (n,)."""
        return self.constants[:, at.PHI_LINE]

    @property
    def phi_per_period(self) -> Array:
        """Mean precession in a nutation period, radians, shape (n,)."""
        return self.constants[:, at.PHI_PER_PERIOD]

    @property
    def psi_per_period(self) -> Array:
        """Mean growth of psi in a nutation period, radians, shape (n,)."""
        return self.constants[:, at.PSI_PER_PERIOD]

    @property
    def theta_range(self) -> Array:
        """The turning points, radians, shape (n, 2)."""
        return self.constants[:, [at.THETA_LOW, at.THETA_HIGH]]

    def __call__(self, times: ArrayLike) -> Motion[Array]:
        """Angles and rates at `times`, each (n, samples)."""
        return Motion(*self._view(times, MOTION).swapaxes(0, 1))

    def quaternion(self, times: ArrayLike) -> Array:
        """Attitudes (w, x, y, z), body to space, shape (n, samples, 4); continuous in time, through poles as well."""
        return self._view(times, QUATERNION)

    def axis(self, times: ArrayLike) -> Array:
        """Unit vectors along the axes, shape (n, samples, 3)."""
        return self._view(times, AXIS)

    def turns(self, times: ArrayLike) -> tuple[Array, Array]:
        """phi and psi alone, each (n, samples), with the bits of a call."""
        phi, psi = self._view(times, TURNS).swapaxes(0, 1)
        return phi, psi

    def momentum(self, times: ArrayLike) -> Array:
        """Angular momenta in the space frame, shape (n, samples, 3)."""
        return self._view(times, MOMENTUM)

    def state(self, times: ArrayLike) -> Array:
        """Quaternions and angular momenta, shape (n, samples, 7): states of the attitude chart."""
        return self._view(times, STATE)

    def run(self, times: ArrayLike) -> tuple[Array, Array]:
        """States (n, samples, 7), and p_phi = L_z and p_psi = L.e read off them, (n, samples, 2)."""
        seen = self._view(times, RUN)
        return seen[..., :7], seen[..., 7:]

    def _view(self, times: ArrayLike, view: int) -> Array:
        given = real_numbers("times", times)
        rows = np.atleast_2d(given)
        if rows.ndim != 2 or (len(rows) != len(self) and given.ndim != 1):
            raise SymtopError(
                f"times must be a row for all members or have the shape ({len(self)}, samples), not {given.shape}"
            )
        return fill(self.constants, rows if rows.flags.writeable else rows.copy(), view)


def checked(numbers: ArrayLike, names: Any = None) -> Array:
    """The rows as compiled code takes them; SymtopError for the first that is no top or no start, by its name."""
    rows = real_numbers("numbers", numbers)
    rows = rows if rows.flags.writeable else rows.copy()  # compiled code takes no other
    if rows.ndim != 2 or rows.shape[1] != len(NUMBERS):
        raise SymtopError(f"numbers must have the shape (n, 9), with {', '.join(NUMBERS)}, not {rows.shape}")
    inertia, theta = rows[:, :2], rows[:, 3]
    good = ((rows <= LARGEST) & (rows >= -LARGEST)).all(axis=1) & (inertia >= 1.0 / LARGEST).all(axis=1)
    with np.errstate(over="ignore"):  # of rows that are refused anyway
        fits = rows[:, 1] <= 2.0 * rows[:, 0]
    good &= fits & (theta >= 0.0) & (theta <= np.pi)
    for member in np.flatnonzero(~good).tolist():
        row = rows[member].tolist()
        try:
            SymmetricTop(*row[:3]), Angles(*row[3:])
        except SymtopError as error:
            called = member if names is None else names[member]
            raise SymtopError(f"member {called}: {error}") from None
    return rows
