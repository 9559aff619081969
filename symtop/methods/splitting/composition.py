"""Splitting methods: a table of coefficients makes one, in the angles or in the space-frame charts.

A composition alternates kicks b_0 .. b_n with drifts a_1 .. a_n (`loop`). The chart says what they are:

    angles          free flight of theta; centrifugal and gravity kicks, singular at the poles (`angles`)
    axis, attitude  the exact free symmetric top; gravity kicks, singular nowhere (`space`)
    body            a free motion of the order of the table, or of order two between Strang's kicks (`body`)

Every method here is explicit and symplectic, all but the symplectic Euler method are symmetric, and all keep p_phi and
p_psi of a top. `stormer-verlet` and its compositions work in the angles chart, all others in the space frame.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, chapters II.5 and V.3.
"""

import math
from collections.abc import Callable, Sequence

from symtop.core.errors import SymtopError, finite, one_of, row
from symtop.methods.framework.angles import on_angles
from symtop.methods.framework.body import on_body
from symtop.methods.framework.loop import FixedStep, Loop, Prepare
from symtop.methods.framework.preparation import ScaledRule
from symtop.methods.framework.registry import Integrator, ModifiedEnergy
from symtop.methods.framework.space import on_attitude, on_axis
from symtop.methods.splitting import angles, body, space
from symtop.methods.splitting.coefficients import METHODS
from symtop.methods.splitting.loop import Composition, exact_sum, packed
from symtop.methods.splitting.rotor import ROTATIONS, TUNED
from symtop.model.charts import BODY

_KERNELS: dict[str, dict[str, tuple[Loop, Prepare]]] = {
    "angles": {"angles": (angles.march, on_angles)},
    "space": {"axis": (space.march_axis, on_axis), "attitude": (space.march_attitude, on_attitude)},
}
# the modified energy and the sleeping threshold of kick-drift-kick, by chart and rotation
_KICK_DRIFT_KICK: dict[tuple[str, str], tuple[ModifiedEnergy, Callable[[float], float] | None]] = {
    ("angles", "exact"): (angles.verlet_energy, None),
    ("space", "exact"): (space.strang_energy, space.strang_sleeps_from),
    ("space", "cayley"): (space.cayley_correction, space.cayley_sleeps_from),
}


def composition(
    name: str, drift: Sequence[float], kick: Sequence[float], gradient: Sequence[float] | None = None, *,
    chart: str = "angles", rotation: str = "exact", processor: float = 0.0, order: int | None = None,
    summary: str = "", reference: str = "",
) -> Integrator:  # fmt: skip
    """A splitting method from its coefficients: kick[0], drift[0], kick[1], ... drift[-1], kick[-1].

    Drifts and kicks must each sum to 1; the middle ones are corrected for rounding, because a sum that is wrong by one
    rounding is a systematic error that grows with time. A zero kick costs nothing.

    `chart` is "angles", or "space" for a method on the axis and on the attitude. Only there, ``gradient[i]`` adds
    ``h^2 {V, {V, T}}`` times itself to ``kick[i] V``; `rotation` is a drift's: "exact", "cayley", or "cayley-tuned",
    whose tau makes the angle right for the root of the mean of |L|^2 over the run; and `processor` is k of the map
    exp(k h^2 (mgl/I1) L.(e x z)), which is applied to the start and undone at each sample.
    `order` is a claim that this function does not check.

    Raises SymtopError for tables that do not fit together or do not sum to 1.
    """
    one_of("chart", chart, _KERNELS)
    one_of("rotation", rotation, ROTATIONS)
    rule, boost = _checked_rule(drift, kick, gradient), finite("processor", processor)
    bare = not any(rule.gradient) and not boost
    if chart == "angles" and not (bare and rotation == "exact"):
        raise SymtopError(
            f"chart must be 'space' for a composition with a gradient, a rotation or a processor, not {chart!r}"
        )
    table = rule._replace(turn=ROTATIONS.index(rotation), processor=boost)
    scale = angles.scale if chart == "angles" else space.tuned if table.turn == TUNED else space.scale
    stages = ScaledRule(table, scale, packed)
    kick_drift_kick = bare and rule.drift == (1.0,) and rule.kick == (0.5, 0.5)
    solvers = {
        key: FixedStep(march, stages, prepare, 1, implicit=False) for key, (march, prepare) in _KERNELS[chart].items()
    }
    turns = body.free_motion(rule, order) if chart == "space" and rotation == "exact" and not boost else None
    if turns is not None:
        solvers[BODY] = FixedStep(body.march(turns), body.scaled(table), on_body, 1, implicit=False)
    kept = ["p_phi", "p_psi"] + ["axis_length"] * (chart == "space")  # drifts are rotations, kicks leave e as it is
    modified, sleeps = (kick_drift_kick and _KICK_DRIFT_KICK.get((chart, rotation))) or (None, None)
    return Integrator(
        name=name, family="splitting",
        summary=summary or f"splitting with {len(rule.drift)} drifts and {rule.forces} forces a step",
        solvers=solvers,
        order=order, explicit=True, symplectic=True, symmetric=all(numbers == numbers[::-1] for numbers in rule[:3]),
        conserves=frozenset(kept + ["cayley_energy"] * (kick_drift_kick and rotation != "exact")),
        reference=reference, needs="this-top" if table.turn == TUNED else "kicks",
        general=chart == "space" and rotation == "exact" and not boost,  # reduced angles, a turn about L, a processor
        modified_energy=modified,
        sleeps_from=sleeps,
    )  # fmt: skip


def _checked_rule(drift: Sequence[float], kick: Sequence[float], gradient: Sequence[float] | None) -> Composition:
    """Coefficients that fit together, their sums closed to exactly 1."""
    drifts, kicks = row("drift", drift), row("kick", kick)
    if len(kicks) != len(drifts) + 1 or not drifts:
        raise SymtopError(f"kick must have one coefficient more than drift, not {len(kicks)} against {len(drifts)}")
    slopes = [0.0] * len(kicks) if gradient is None else row("gradient", gradient)
    if len(slopes) != len(kicks):
        raise SymtopError(f"gradient must have as many coefficients as kick, not {len(slopes)} against {len(kicks)}")
    for name, values in (("drift", drifts), ("kick", kicks)):
        if abs(math.fsum(values) - 1.0) > 1e-12:
            raise SymtopError(f"{name} coefficients must sum to 1, not {math.fsum(values)!r}")
    if any(c != 0.0 and b == 0.0 for b, c in zip(kicks, slopes, strict=True)):
        raise SymtopError(f"gradient must be zero where kick is, not {slopes} with {kicks}")
    forces = sum(b != 0.0 for b in kicks) - (kicks[0] != 0.0 and kicks[-1] != 0.0)
    return Composition(exact_sum(drifts), exact_sum(kicks), tuple(slopes), forces)


def built_in() -> list[Integrator]:
    """The compositions that ship with symtop."""
    return [
        composition(
            name, *method.table[1:], chart=method.chart, rotation=method.rotation, processor=method.processor,
            order=method.table.order, summary=method.summary, reference=method.reference,
        )
        for name, method in METHODS.items()
    ]  # fmt: skip
