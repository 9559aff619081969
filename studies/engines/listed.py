"""The tables of the study of engines: the steps in use, the same cost, orders and shares, and what engines say."""

import math
from typing import Any, NamedTuple

import xarray as xr

from symtop.methods.framework.registry import integrator
from symtop.runner.study import Table

from . import words
from .tables import FREQUENCIES, HORIZON, SCENES

CHANGES = ("energy", "spin", "precession")


def tables(data: xr.DataTree) -> list[Table]:
    """All of them."""
    return [orders(data), kinds(data), *spherical(data), used(data), same_cost(data), said()]


def orders(data: xr.DataTree) -> Table:
    """What the order of a map decides: the range of errors over the maps of each."""
    lines = []
    for order, group in words.by_order(data).items():
        off = [words.span((words.frame(data, row, "axis", rate) for row in group), words.angle) for rate in FREQUENCIES]
        fast = words.span((words.frame(data, row, "axis", words.USUAL, scene=words.FAST) for row in group), words.angle)
        shares = words.span((words.share(data, row) for row in group), "{:.0%}".format)
        lines.append([f"{order}{'' if order else ' (no gyroscopic term)'}", str(len(group)), *off, fast, shares])
    header = [
        "order", "maps of engines", *(f"axis on {words.SLOW}, 1/{rate:g} s" for rate in FREQUENCIES),
        f"axis on {words.FAST}, 1/{words.USUAL:g} s", "random tops followed to 5 degrees",
    ]  # fmt: skip
    return Table(f"Errors within {HORIZON:g} s by the order of the map, in double precision", header, lines)


def spherical(data: xr.DataTree) -> list[Table]:
    """How near the maps without the gyroscopic term are to the spherical top; none if there is no such map."""
    lines = [
        [row, *(f"{words.frame(data, row, 'spherical', rate):.1e}" for rate in FREQUENCIES),
         f"{words.order_of_difference(data, row):.2f}", words.angle(words.frame(data, row, "axis", words.USUAL)),
         f"{1.0 + words.frame(data, row, 'precession', words.USUAL, scene=words.FAST):.2f}"]
        for row in words.without_term(data)
    ]  # fmt: skip
    title = f"Without a gyroscopic term: the axis (rad) from the spherical top's, within {HORIZON:g} s of {words.SLOW}"
    header = ["variant", *(f"1/{rate:g} s" for rate in FREQUENCIES), "order",
              f"from the true axis, 1/{words.USUAL:g} s",
              f"{words.FAST} precesses at this part of its rate"]  # fmt: skip
    return [Table(title, header, lines)] if lines else []


def used(data: xr.DataTree) -> Table:
    """Errors at the steps that people use, after a short time and a long one."""

    def shown(scene: str, row: str, rate: float) -> list[str]:
        def cell(name: str, form: str, *, long: bool) -> str:
            value = words.frame(data, row, name, rate, scene=scene, long=long)
            return format(value, form) if math.isfinite(value) else "ended early"

        forces = words.frame(data, row, "forces", rate, scene=scene) / HORIZON
        short = [
            cell("axis", ".1e", long=False),
            *(cell(name, "+.1e", long=False) for name in ("energy", "precession")),
        ]
        changes = [cell(name, "+.1e", long=True) for name in CHANGES]
        return [scene, row, f"1/{rate:g}", f"{forces:.0f}", *short, cell("axis", ".1e", long=True), *changes]

    long = f"{words.seconds(data):g} s"
    header = [
        "scene", "variant", "step (s)", "forces a second",
        *(f"{name}, {HORIZON:g} s" for name in ("axis", "energy", "precession")),
        *(f"{name}, {long}" for name in ("axis", *CHANGES)),
    ]  # fmt: skip
    rows = [shown(scene, row, rate) for scene in SCENES for row in words.rows(data) for rate in FREQUENCIES]
    return Table("At the steps that people use", header, rows)


def same_cost(data: xr.DataTree) -> Table:
    """The axis error at as many evaluations of the torque."""
    header = [
        "variant", "evaluations a step",
        *(f"{scene}, {rate:g} a second, {time:g} s" for scene in SCENES for rate in FREQUENCIES
          for time in (HORIZON, words.seconds(data))),
    ]  # fmt: skip
    rows = []
    for row in words.rows(data):
        forces = float(data["tops"]["forces_a_step"].sel(scene=words.SLOW, variant=row))
        off = [
            words.level(data, row, rate, scene=scene, long=long)
            for scene in SCENES for rate in FREQUENCIES for long in (False, True)
        ]  # fmt: skip
        rows.append([row, f"{forces:g}", *(f"{value:.1e}" for value in off)])
    return Table("Axis error (rad) with the same number of evaluations of the torque", header, rows)


def kinds(data: xr.DataTree) -> Table:
    """Every map: what it is, order, least error, what it does at the usual step, and its share of the population."""
    rows: list[list[str]] = []
    for row in words.rows(data):
        known: Any = words.facts(data, row)
        off = [words.angle(words.frame(data, row, "axis", rate)) for rate in FREQUENCIES]
        changes = [words.change(words.frame(data, row, name, words.USUAL, long=True)) for name in CHANGES]
        rows.append([
            row, integrator(row).summary, f"{known.order:.2f}", *off,
            words.angle(words.frame(data, row, "axis", words.USUAL, scene=words.FAST)), *changes,
            f"{known.best:.1e}", f"{known.best_count:,.0f}", f"{known.last:.1e}", f"{words.share(data, row):.0%}",
        ])  # fmt: skip
    step, long = f"1/{words.USUAL:g} s", f"{words.seconds(data):g} s"
    title = (
        f"Every map: order, axis error within {HORIZON:g} s, changes in {long} of {words.SLOW} at {step}, least error, "
        "and the share of the population within 5 degrees"
    )
    header = [
        "variant", "what it is", "order", *(f"axis on {words.SLOW}, 1/{rate:g} s" for rate in FREQUENCIES),
        f"axis on {words.FAST}, {step}", *(f"{name}, {long}" for name in CHANGES), "least axis error (rad)",
        "at steps a nutation", "at the most steps (rad)", "share",
    ]  # fmt: skip
    return Table(title, header, rows)


def said() -> Table:
    """What the engines' own documentation says."""
    return Table(
        "What the documentation of the engines says of it",
        ["engine", "what it says", "source"],
        [list(statement) for statement in STATEMENTS],
    )


class Statement(NamedTuple):
    """What an engine's documentation says of the rotation of a body, in our words, and where.

    The source is a file of the version that is named; what was found by asking the running engine says so.
    """

    engine: str
    says: str
    source: str


STATEMENTS = (
    Statement(
        "MuJoCo",
        "Euler is semi-implicit and the default, RK4 is of fourth order, implicit and implicitfast treat the velocity "
        "implicitly; implicitfast leaves out the derivatives of Coriolis and centripetal forces and has been "
        "recommended for new models since 2.3.3.",
        "mjtype.h, 4.0.0; changelog of 2.3.3",
    ),
    Statement(
        "Bullet",
        "The implicit gyroscopic term in body axes is on by default since 2.83; the explicit one is best avoided, "
        "because it gains energy.",
        "btRigidBody.h, 3.24",
    ),
    Statement(
        "Jolt",
        "mApplyGyroscopicForce makes a body show the Dzhanibekov effect; its default is off.",
        "BodyCreationSettings.h, 5.5.0",
    ),
    Statement(
        "PhysX",
        "eENABLE_GYROSCOPIC_FORCES has gyroscopic forces computed for a rigid body; the corresponding argument of the "
        "immediate mode is off by default.",
        "PxRigidBody.h and PxImmediateMode.h, 5.6.1",
    ),
    Statement(
        "Havok", "The interface has no setting of the gyroscopic term.", "HavokPhysics.d.ts of @babylonjs/havok, 1.3.14"
    ),
    Statement("cannon-es", "The interface has no setting of the gyroscopic term.", "cannon-es.d.ts, 0.20.0"),
    Statement(
        "Rapier",
        "gyroscopic_forces switches the term for a body; a new body has it on.",
        "_rapier3d.pyi of rapier3d, 0.36.1, and the default as the package answers it",
    ),
    Statement(
        "ODE",
        "The gyroscopic mode of a body is on by default; switching it off usually improves stability and helps with "
        "spinning bodies such as wheels.",
        "objects.h, 0.16.2",
    ),
    Statement(
        "Simbody",
        "SemiExplicitEuler is explicit in velocity-dependent terms, as is usual in games, and is not expected to do "
        "well at very high rates of rotation; Verlet at a fixed step conserves energy well.",
        "SemiExplicitEulerIntegrator.h and VerletIntegrator.h, 3.7",
    ),
    Statement(
        "LAMMPS",
        "rigid uses Richardson iterations; rigid/nve uses the method of Miller et al., thought to conserve the "
        "energy better.",
        "doc/src/fix_rigid.rst",
    ),
    Statement(
        "YADE",
        "exactAsphericalRot, on by default, is the formulation of Allen and Tildesley; later versions choose among "
        "three by rotAlgorithm, of which that of del Valle (2023) is the default.",
        "NewtonIntegrator.hpp, before rotAlgorithm and since",
    ),
    Statement(
        "JSBSim",
        "The integrators of rate and position are chosen by four properties under simulation/integrator; both "
        "rotational ones are 1, rectangular Euler, unless they are set.",
        "FGPropagate.h, and the defaults as 1.3.3 answers them",
    ),
)
