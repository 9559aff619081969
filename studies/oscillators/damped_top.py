"""The damped top: forced discrete Euler-Lagrange equations with a viscous torque on precession and on spin.

    F_phi = -c_phi phi',    F_psi = -c_psi psi'        (two bearings of a gimbal; power -c_phi phi'^2 - c_psi psi'^2)

With the discrete Lagrangian of `unreduced` and the forces F_d^- = h sum w (1-a) F, F_d^+ = h sum w a F by virtual work,
a symmetric rule gives, with the mean rates (w, v, u) = (dtheta, dphi, dpsi)/h and the sums l, m over its nodes,

    p_phi0 = -D1 L_d - F_d^- = sum w l + (h/2) c_phi v,    p_phi1 = D2 L_d + F_d^+ = sum w l - (h/2) c_phi v

and psi likewise, so that the momenta are not conserved but balanced, p_phi1 - p_phi0 = -c_phi (phi1 - phi0) exactly:
the motion itself has the same invariants p_phi + c_phi phi and p_psi + c_psi psi, and the discrete one keeps them to
rounding. Order 2.
The conservation laws of the free top are the case c = 0, and this kernel is then `unreduced`.
Not in the registry, whose methods step the free top. Source: Marsden and West, Acta Numerica 10 (2001) 357, part three.
"""

from typing import Any, NamedTuple

from symtop.base.validate import SymtopError, finite, one_of
from symtop.methods import unreduced
from symtop.methods.compiled import register_jitable
from symtop.methods.loop import March, Marks, driver
from symtop.methods.quadrature import RULES, quadrature
from symtop.methods.unreduced import unreduced_step, with_momenta
from symtop.model.top import Angles, SymmetricTop

begin = unreduced.begin
observe = unreduced.observe


class Friction(NamedTuple):
    """Viscous coefficients of the two bearings, torque per rate."""

    precession: float
    spin: float

    def checked(self) -> "Friction":
        """The same as floats; refuses negative ones."""
        for name, value in zip(self._fields, self, strict=True):
            if finite(f"{name} friction", value) < 0.0:
                raise SymtopError(f"{name} friction must be at least zero, not {value!r}")
        return Friction(*map(float, self))


class DampedTop(NamedTuple):
    """The top and its friction: the momenta are state."""

    I1: float
    I3: float
    mgl: float
    c_phi: float
    c_psi: float


@register_jitable
def _damped_inertia(par: Any, sums: Any, h: float) -> Any:
    """That of `unreduced` with half a step of friction."""
    return sums.across + 0.5 * h * par.c_phi, par.I3 + 0.5 * h * par.c_psi


@register_jitable
def _damped_momenta(par: Any, sums: Any, v: float, u: float, h: float) -> Any:
    """D2 L_d + F_d^+, from the sums and from nothing else: the balance is a result, not an input."""
    p_phi = sums.across * v + sums.mixed * u - 0.5 * h * par.c_phi * v
    return p_phi, sums.mixed * v + par.I3 * u - 0.5 * h * par.c_psi * u


def increment(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (theta, phi, psi, p_theta, p_phi, p_psi); the work counted is the number of Newton iterations."""
    return unreduced_step(_damped_inertia, _damped_momenta, par, rule, state, carry, h)


march = driver(begin, increment, observe)


def damped_run(top: SymmetricTop, start: Angles, friction: Friction, rule: str, h: float, marks: Marks) -> March:
    """States (theta, phi, psi, p_theta, p_phi, p_psi) after the numbers of steps in `marks`, shape (samples, 6).

    `rule` is a name of `quadrature.RULES`. SymtopError for a pole, an unknown rule or a bad friction.
    """
    numbers = quadrature(*RULES[one_of("rule", rule, RULES)][:2])[0]
    bare, state = with_momenta(top, start)
    return march(DampedTop(*bare, *friction.checked()), numbers, state, h, marks)
