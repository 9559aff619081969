"""The integrators that physics engines ship, as methods of the registry: family ``engine``.

People choose an engine and get its integrator. Each of these is the map that an engine takes a free body with a torque
through, written down again from its source and run against it (`make engines`); the top is a body whose centre is
fixed, in a torque mgl k x e. Only the map is here: no contacts, no joints, no damping, no limit of speed.

Comparisons of methods leave this family out (`registry.methods`); the claims table judges it and a study of its own
runs it. An engine that works in single precision has its map in both, as ``jolt`` and ``jolt-float32``: the first shows
the method, the second what rounding makes of it, and of a limit h -> 0 it claims nothing.
"""

from collections.abc import Callable, Mapping
from typing import Any

from symtop.methods.engines import maps, maps as kicks, maps as schemes
from symtop.methods.engines.loop import (
    ANGULAR_MOMENTUM,
    VELOCITY,
    Carried,
    Substeps,
    acceleration,
    attitude_loop,
    axis_loop,
    nothing,
    single,
)
from symtop.methods.framework.fixed_step import FixedStep
from symtop.methods.framework.loop import Loop
from symtop.methods.framework.registry import ENGINE, Integrator


def _entry(
    name: str, loops: dict[str, Loop], order: int | None, summary: str, reference: str, keeps: str = "", *,
    carried: Mapping[str, Carried] = VELOCITY, rule: Any = None, forces: int = 1, symplectic: bool = False,
    energy_error: str | None = None, precision: str = "double", needs: str = "group",
) -> Integrator:  # fmt: skip
    """The record of a map from its loops, by chart; `keeps` names the momenta that it conserves."""
    return Integrator(
        name=name, family=ENGINE, summary=summary, reference=reference, order=order, explicit=True,
        symplectic=symplectic, symmetric=symplectic, conserves=frozenset(keeps.split()), energy_error=energy_error,
        precision=precision, needs=needs, general=True,
        solvers={
            chart: FixedStep(loop, rule or Substeps(), carried[chart].prepare, forces, implicit=False)
            for chart, loop in loops.items()
        },
    )  # fmt: skip


def _engine(
    name: str, step: Callable[..., Any], order: int | None, summary: str, reference: str, keeps: str = "", *,
    carried: Mapping[str, Carried] = VELOCITY, reused: Callable[..., Any] = nothing, **more: Any,
) -> Integrator:  # fmt: skip
    """A map in double, on the axis and on the attitude."""
    loops = {
        "axis": axis_loop(step, carried["axis"], reused),
        "attitude": attitude_loop(step, carried["attitude"], reused),
    }
    return _entry(name, loops, order, summary, reference, keeps, carried=carried, **more)


def _both(
    name: str, step: Callable[..., Any], order: int | None, summary: str, reference: str, keeps: str = "",
    rule: Any = None, energy_error: str | None = None,
) -> list[Integrator]:  # fmt: skip
    """A map in double and in the single precision of the engine, there on the attitude as the engine steps it."""
    rounded = {"attitude": attitude_loop(step, VELOCITY["attitude"], number=single)}
    in_single = f"{summary}, in single precision"
    return [
        _engine(name, step, order, summary, reference, keeps, rule=rule, energy_error=energy_error),
        _entry(f"{name}-float32", rounded, None, in_single, reference, rule=rule, precision="single"),
    ]


def built_in() -> list[Integrator]:
    """The maps in double, and those of engines in single precision in that, too."""
    return [
        *_both("no-gyro", kicks.no_gyro, None, "Havok, PhysX and Jolt by default: no gyroscopic term",
               "havok physx jolt", "p_psi", energy_error="bounded"),
        _engine("no-gyro-linear", kicks.no_gyro_linear, None,
                "cannon-es, ODE with its gyroscopic mode off: no gyroscopic term, a linear turn", "cannon-es ode",
                "p_psi", energy_error="bounded"),
        _engine("mujoco-euler", kicks.explicit, 1, "MuJoCo Euler, PyBullet, DART: explicit gyroscopic term",
                "mujoco pybullet dart"),
        _engine("mujoco-implicit", kicks.implicit, 1, "MuJoCo implicit: one Newton step of the velocity",
                "mujoco", "p_psi"),
        *_both("bullet", kicks.implicit_then_torque, 1, "Bullet by default: implicit gyroscopic term, then the torque",
               "bullet", "p_psi"),
        *_both("jolt", kicks.rescaled_then_torque, 1, "Jolt with its gyroscopic term: |L| kept, then the torque",
               "jolt"),
        *_both("physx", kicks.torque_then_rescaled, 1, "PhysX with its gyroscopic flag: the torque, then |L| kept",
               "physx"),
        *_both("rapier", kicks.substepped, 1, "Rapier by default: four substeps, |L| kept in each",
               "rapier", rule=Substeps(4, 0.25)),
        _engine("ode", kicks.projected_then_torque, 1, "ODE by default: gyroscopic term implicit in the velocity",
                "ode lacoursiere-2006"),
        _engine("lammps-rigid", schemes.richardson, 2, "LAMMPS fix rigid: half kicks around an extrapolated rotation",
                "lammps", "p_phi", carried=ANGULAR_MOMENTUM),
        _entry("no-squish", {"attitude": maps.march_no_squish}, 2, "LAMMPS fix rigid/nve: turns about the body's axes",
               "miller-2002 lammps", "p_phi", carried=ANGULAR_MOMENTUM, symplectic=True, needs="kicks"),
        _engine("yade", schemes.fincham_at_start, 1, "YADE: rotational leapfrog with the axes of the start of a step",
                "yade", "p_phi", carried=ANGULAR_MOMENTUM),
        _engine("fincham", schemes.fincham, 2, "the rotational leapfrog as published", "fincham-1992", "p_phi",
                carried=ANGULAR_MOMENTUM),
        _engine("mujoco3-rk4", schemes.runge_kutta_on_rates, 2, "MuJoCo RK4 up to 3.17: stages turn by their rates",
                "mujoco-3", "p_psi", forces=4),
        _engine("rkmk4", schemes.runge_kutta_munthe_kaas, 4, "MuJoCo 4.0 RK4, Exudyn: Runge-Kutta-Munthe-Kaas",
                "munthe-kaas-1999 mujoco exudyn", "p_psi", forces=4),
        _engine("jsbsim-default", schemes.explicit_euler, 1, "JSBSim by default: explicit Euler", "jsbsim"),
        _engine("jsbsim-buss2", schemes.adams_bashforth, 2, "JSBSim Buss2 and AB2: Adams-Bashforth and Magnus",
                "jsbsim buss-2000", reused=acceleration),
    ]  # fmt: skip
