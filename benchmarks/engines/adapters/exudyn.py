"""Exudyn: explicit Runge-Kutta on Lie groups, a node of rotation vectors, the torque as a load in every stage."""

import functools
from importlib import metadata
from typing import Any

import numpy as np

from benchmarks.engines import FREE, Setting
from benchmarks.engines.common import Body, Path, Recorder, quaternion

ENGINE = "Exudyn"


def _run(exudyn: Any, scheme: str, body: Body, h: float, steps: int) -> Path:
    from exudyn.utilities import MarkerNodeRigid, RigidBodyInertia, Torque

    system, recorder = exudyn.SystemContainer().AddSystem(), Recorder()
    inertia = RigidBodyInertia(mass=1, inertiaTensor=np.diag([body.I1, body.I1, body.I3]), com=[0, 0, 0])
    result = system.CreateRigidBody(
        inertia=inertia, nodeType=exudyn.NodeType.RotationRotationVector, referencePosition=[0, 0, 0],
        referenceRotationMatrix=body.rotation, initialAngularVelocity=body.velocity.tolist(), gravity=[0, 0, 0],
        returnDict=True,
    )  # fmt: skip
    node, kinds = result["nodeNumber"], exudyn.OutputVariableType

    def load(system: Any, time: float, vector: Any) -> list[float]:
        del time, vector
        turn = system.GetNodeOutput(node, kinds.RotationMatrix)
        return [-body.mgl * turn[5], body.mgl * turn[2], 0.0]

    def note(system: Any, time: float) -> bool:
        del time
        turn = np.array(system.GetNodeOutput(node, kinds.RotationMatrix)).reshape(3, 3)
        recorder.add(quaternion(turn), system.GetNodeOutput(node, kinds.AngularVelocity))
        return True

    marker = system.AddMarker(MarkerNodeRigid(nodeNumber=node))
    system.AddLoad(Torque(markerNumber=marker, loadVector=[0, 0, 0], loadVectorUserFunction=load))
    system.SetPostStepUserFunction(note)
    system.Assemble()
    options = exudyn.SimulationSettings()
    options.timeIntegration.numberOfSteps, options.timeIntegration.endTime = steps, steps * h
    options.timeIntegration.verboseMode = 0
    options.timeIntegration.explicitIntegration.useLieGroupIntegration = True
    options.solutionSettings.writeSolutionToFile = False
    recorder.add(body.attitude, body.velocity)
    system.SolveDynamic(options, solverType=getattr(exudyn.DynamicSolverType, scheme), storeSolver=False)
    path = recorder.path()
    return Path(path.attitude[-steps - 1 :], path.velocity[-steps - 1 :])


def settings() -> list[Setting]:
    """The classical tableau."""
    import exudyn

    version = metadata.version("exudyn")
    return [Setting(ENGINE, version, "RK44, Lie group", FREE, "rkmk4", functools.partial(_run, exudyn, "RK44"))]
