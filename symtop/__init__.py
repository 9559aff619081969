"""symtop: integrators compared on the heavy symmetric top.

    >>> import symtop
    >>> data = symtop.simulate("spheroid", "midpoint", step_size=0.01)

Names are imported on first use, so that ``import symtop`` costs nothing; type checkers see where each comes from.
"""

import ast
import importlib
from pathlib import Path
from typing import TYPE_CHECKING

from symtop.core import __version__ as __version__

if TYPE_CHECKING:
    from symtop.advise import Advice as Advice, recommend as recommend
    from symtop.core.errors import SymtopError as SymtopError, SymtopWarning as SymtopWarning
    from symtop.judging.comparison import compare as compare
    from symtop.judging.judge_step import judge as judge
    from symtop.measure.errors import errors as errors
    from symtop.measure.sweep import sweep as sweep
    from symtop.methods.framework.angles import chart_outcome as chart_outcome, on_angles as on_angles
    from symtop.methods.framework.equations import field as field
    from symtop.methods.framework.loop import FixedStep as FixedStep, kernel_loop as kernel_loop
    from symtop.methods.framework.plan import Plan as Plan, Run as Run
    from symtop.methods.framework.registry import (
        Integrator as Integrator,
        citation as citation,
        integrator as integrator,
        integrators as integrators,
        register as register,
    )
    from symtop.methods.framework.space import on_attitude as on_attitude, on_axis as on_axis
    from symtop.methods.lagrangian.discrete_lagrangian import discrete_lagrangian as discrete_lagrangian
    from symtop.methods.runge_kutta.explicit import runge_kutta as runge_kutta
    from symtop.methods.splitting.composition import composition as composition
    from symtop.methods.taylor.series import series as series
    from symtop.model.body import Attitude as Attitude, RigidBody as RigidBody
    from symtop.model.exact.closed_form import ClosedForm as ClosedForm
    from symtop.model.scenes import (
        Scene as Scene,
        body_scenes as body_scenes,
        register_scene as register_scene,
        scene as scene,
        scenes as scenes,
    )
    from symtop.model.top import Angles as Angles, Momenta as Momenta, SymmetricTop as SymmetricTop
    from symtop.report.card import card as card
    from symtop.report.plot import plot as plot
    from symtop.run.ensemble.bodies import body_population as body_population
    from symtop.run.ensemble.ensemble import ensemble as ensemble
    from symtop.run.ensemble.population import population as population
    from symtop.run.long_run import long_run as long_run
    from symtop.run.reference.truth import reference as reference
    from symtop.run.right_hand_side import guard as guard
    from symtop.run.simulation import simulate as simulate
    from symtop.runner.study import Case as Case, Picture as Picture, Study as Study

_HOME = {  # the module of each name, as the block above has it for type checkers
    name.name: str(line.module)
    for line in ast.walk(ast.parse(Path(__file__).read_text(encoding="utf-8")))
    if isinstance(line, ast.ImportFrom) and line.col_offset > 0
    for name in line.names
}

__all__ = ["__version__", *_HOME]  # noqa: PLE0604  (strings all)

if not TYPE_CHECKING:  # a checker must not take it for a promise that every name is there

    def __getattr__(name: str) -> object:
        if name not in _HOME:
            raise AttributeError(f"module 'symtop' has no attribute {name!r}")
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return __all__
