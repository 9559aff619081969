"""The closed form as an integrator: no step, no tolerance, no growth of error; the reference for all others.

Source: Klein and Sommerfeld, Theory of the Top, chapter 6; see `symtop.model.exact.closed_form`.
"""

from symtop.methods.framework.plan import Plan, Run
from symtop.methods.framework.registry import Integrator
from symtop.model.exact.closed_form import ClosedForm
from symtop.model.top import Angles, SymmetricTop


def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
    """Attitude and angular momentum at the sample times."""
    states, p_phi, p_psi = ClosedForm(top, start).run(plan.times)
    return Run(states, p_phi, p_psi, 0, plan.times.size, 0, "ok", plan.horizon)


def built_in() -> list[Integrator]:
    """The closed form under the name `exact`."""
    return [
        Integrator(
            name="exact", family="exact",
            summary="closed form in elliptic functions, in double; one evaluation a sample",
            solvers={"attitude": solve},
            control=None, explicit=True, symplectic=True, symmetric=True,
            conserves=frozenset({"energy", "p_phi", "p_psi"}),
            reference="klein-sommerfeld-1910", needs="solution", general=False,
        )
    ]  # fmt: skip
