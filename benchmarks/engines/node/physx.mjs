// PhysX in single precision; the setting "gyroscopic" sets eENABLE_GYROSCOPIC_FORCES, which is off by default.
//
// The package is built for browsers: `process` is hidden while it starts, and it is given its binary.

import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { pathToFileURL } from "node:url";

const GYROSCOPIC = 1024; // PxRigidBodyFlag::eENABLE_GYROSCOPIC_FORCES, which the package's enumeration leaves out
const FAST = 1e6; // rad/s

async function load(top) {
  const file = top.require.resolve("physx-js-webidl");
  const { default: start } = await import(pathToFileURL(file));
  const wasmBinary = readFileSync(join(dirname(file), "physx-js-webidl.wasm"));
  const node = globalThis.process;
  globalThis.window = globalThis;
  globalThis.process = undefined;
  try {
    return await start({ wasmBinary });
  } finally {
    globalThis.process = node;
  }
}

export async function body(top) {
  const physx = await load(top);
  const vector = (parts) => new physx.PxVec3(...parts);
  const pose = (place, [w, x, y, z]) => new physx.PxTransform(vector(place), new physx.PxQuat(x, y, z, w));
  const here = [1.0, 0.0, 0.0, 0.0];
  const foundation = physx.CreateFoundation(
    physx.PHYSICS_VERSION, new physx.PxDefaultAllocator(), new physx.PxDefaultErrorCallback(),
  );
  const tolerances = new physx.PxTolerancesScale();
  const physics = physx.CreatePhysics(physx.PHYSICS_VERSION, foundation, tolerances);
  const plan = new physx.PxSceneDesc(tolerances);
  plan.set_gravity(vector([0.0, 0.0, top.gravity]));
  plan.set_cpuDispatcher(physx.DefaultCpuDispatcherCreate(0));
  plan.set_filterShader(physx.DefaultFilterShader());
  const scene = physics.createScene(plan);
  const made = physics.createRigidDynamic(pose(top.place, top.attitude));
  const material = physics.createMaterial(0.0, 0.0, 0.0);
  made.attachShape(physics.createShape(new physx.PxSphereGeometry(0.01), material, true));
  made.setMass(1.0);
  made.setMassSpaceInertiaTensor(vector(top.moments));
  made.setAngularDamping(0.0);
  made.setLinearDamping(0.0);
  made.setMaxAngularVelocity(FAST);
  made.setSleepThreshold(0.0);
  made.setStabilizationThreshold(0.0);
  made.setRigidBodyFlag(GYROSCOPIC, top.setting === "gyroscopic");
  scene.addActor(made);
  made.setAngularVelocity(vector(top.velocity));
  made.setLinearVelocity(vector(top.speed));
  if (top.pinned) {
    physx.InitExtensions(physics);
    const tail = pose([0.0, 0.0, -top.arm], here);
    physx.SphericalJointCreate(physics, null, pose([0.0, 0.0, 0.0], here), made, tail);
  }
  const torque = vector([0.0, 0.0, 0.0]);
  return {
    state: () => {
      const { q } = made.getGlobalPose();
      const attitude = [q.w, q.x, q.y, q.z];
      const v = made.getAngularVelocity();
      return [...attitude, v.x, v.y, v.z];
    },
    push: (a, b, c) => {
      torque.x = a;
      torque.y = b;
      torque.z = c;
      made.addTorque(torque, physx.PxForceModeEnum.eFORCE);
    },
    step: () => {
      scene.simulate(top.h);
      scene.fetchResults(true);
    },
  };
}
