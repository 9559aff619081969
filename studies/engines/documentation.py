"""What the engines' own documentation says of the rotation of a body: settings, defaults and advice, with the source.

In our words, from the file and the version that is named; what was found by asking the running engine says so.
"""

from typing import NamedTuple


class Statement(NamedTuple):
    """What an engine's documentation says, and where."""

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
