// Havok in single precision, as Babylon.js ships it. It has no switch of a gyroscopic term, and takes an angular impulse
// instead of a torque.

import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";

const FAST = 1e6; // rad/s and m/s

export async function body(top) {
  const start = top.require("@babylonjs/havok");
  const folder = dirname(top.require.resolve("@babylonjs/havok"));
  const wasmBinary = readFileSync(join(folder, "HavokPhysics.wasm"));
  const quiet = { print() {}, printErr() {} };
  const havok = await (start.default ?? start)({ wasmBinary, ...quiet });
  const h = Math.fround(top.h);
  const world = havok.HP_World_Create()[1];
  havok.HP_World_SetGravity(world, [0.0, 0.0, top.gravity]);
  havok.HP_World_SetIdealStepTime(world, top.h);
  havok.HP_World_SetSpeedLimit(world, FAST, FAST);
  const made = havok.HP_Body_Create()[1];
  const [w, x, y, z] = top.attitude;
  havok.HP_Body_SetMotionType(made, havok.MotionType.DYNAMIC);
  havok.HP_Body_SetShape(made, havok.HP_Shape_CreateSphere([0.0, 0.0, 0.0], 0.01)[1]);
  havok.HP_Body_SetMassProperties(made, [[0.0, 0.0, 0.0], 1.0, top.moments, [0.0, 0.0, 0.0, 1.0]]);
  havok.HP_Body_SetQTransform(made, [top.place, [x, y, z, w]]);
  havok.HP_Body_SetLinearDamping(made, 0.0);
  havok.HP_Body_SetAngularDamping(made, 0.0);
  havok.HP_Body_SetActivationControl(made, havok.ActivationControl.ALWAYS_ACTIVE);
  havok.HP_World_AddBody(world, made, false);
  havok.HP_Body_SetAngularVelocity(made, top.velocity);
  havok.HP_Body_SetLinearVelocity(made, top.speed);
  if (top.pinned) {
    pin(havok, world, made, top.arm);
  }
  return {
    state: () => {
      const q = havok.HP_Body_GetOrientation(made)[1];
      return [q[3], q[0], q[1], q[2], ...havok.HP_Body_GetAngularVelocity(made)[1]];
    },
    push: (a, b, c) => havok.HP_Body_ApplyAngularImpulse(made, [a * h, b * h, c * h]),
    step: () => havok.HP_World_Step(world, top.h),
  };
}

function pin(havok, world, made, arm) {
  const base = havok.HP_Body_Create()[1];
  havok.HP_Body_SetMotionType(base, havok.MotionType.STATIC);
  havok.HP_World_AddBody(world, base, false);
  const joint = havok.HP_Constraint_Create()[1];
  havok.HP_Constraint_SetParentBody(joint, base);
  havok.HP_Constraint_SetChildBody(joint, made);
  havok.HP_Constraint_SetAnchorInParent(joint, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
  havok.HP_Constraint_SetAnchorInChild(joint, [0.0, 0.0, -arm], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
  for (const name of ["LINEAR_X", "LINEAR_Y", "LINEAR_Z"]) {
    havok.HP_Constraint_SetAxisMode(joint, havok.ConstraintAxis[name], havok.ConstraintAxisLimitMode.LOCKED);
  }
  havok.HP_Constraint_SetEnabled(joint, 1);
}
