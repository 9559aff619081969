// Jolt in single precision; the setting "gyroscopic" switches mApplyGyroscopicForce on, which is off by default.

import { pathToFileURL } from "node:url";

const FAST = 1e6; // rad/s and m/s, above any speed of a scene

function world(jolt, gravity) {
  const settings = new jolt.JoltSettings();
  const pairs = new jolt.ObjectLayerPairFilterTable(2);
  const layers = new jolt.BroadPhaseLayerInterfaceTable(2, 2);
  for (const layer of [0, 1]) {
    layers.MapObjectToBroadPhaseLayer(layer, new jolt.BroadPhaseLayer(layer));
  }
  settings.mMaxWorkerThreads = 0;
  settings.mObjectLayerPairFilter = pairs;
  settings.mBroadPhaseLayerInterface = layers;
  settings.mObjectVsBroadPhaseLayerFilter = new jolt.ObjectVsBroadPhaseLayerFilterTable(layers, 2, pairs, 2);
  const made = new jolt.JoltInterface(settings);
  made.GetPhysicsSystem().SetGravity(new jolt.Vec3(0.0, 0.0, gravity));
  return made;
}

export async function body(top) {
  const start = (await import(pathToFileURL(top.require.resolve("jolt-physics")))).default;
  const jolt = await start();
  const scene = world(jolt, top.gravity);
  const system = scene.GetPhysicsSystem();
  const bodies = system.GetBodyInterface();
  const [w, x, y, z] = top.attitude;
  const plan = new jolt.BodyCreationSettings(
    new jolt.SphereShape(0.5), new jolt.RVec3(...top.place), new jolt.Quat(x, y, z, w), jolt.EMotionType_Dynamic, 1,
  );
  plan.mOverrideMassProperties = jolt.EOverrideMassProperties_MassAndInertiaProvided;
  plan.mMassPropertiesOverride.mMass = 1.0;
  [...top.moments, 1.0].forEach((moment, i) => {
    const column = [0.0, 0.0, 0.0, 0.0];
    column[i] = moment;
    plan.mMassPropertiesOverride.mInertia.SetColumn4(i, new jolt.Vec4(...column));
  });
  plan.mLinearDamping = 0.0;
  plan.mAngularDamping = 0.0;
  plan.mMaxAngularVelocity = FAST;
  plan.mMaxLinearVelocity = FAST;
  plan.mAllowSleeping = false;
  plan.mApplyGyroscopicForce = top.setting === "gyroscopic";
  const made = bodies.CreateBody(plan);
  bodies.AddBody(made.GetID(), jolt.EActivation_Activate);
  made.SetLinearVelocity(new jolt.Vec3(...top.speed));
  made.SetAngularVelocity(new jolt.Vec3(...top.velocity));
  if (top.pinned) {
    const joint = new jolt.PointConstraintSettings();
    joint.mSpace = jolt.EConstraintSpace_WorldSpace;
    joint.mPoint1 = new jolt.RVec3(0.0, 0.0, 0.0);
    joint.mPoint2 = new jolt.RVec3(0.0, 0.0, 0.0);
    system.AddConstraint(joint.Create(jolt.Body.prototype.sFixedToWorld, made));
  }
  const torque = new jolt.Vec3(0.0, 0.0, 0.0);
  return {
    state: () => {
      // each getter of a wrapped object fills one and the same object: read a quaternion before the next call
      const q = made.GetRotation();
      const attitude = [q.GetW(), q.GetX(), q.GetY(), q.GetZ()];
      const v = made.GetAngularVelocity();
      return [...attitude, v.GetX(), v.GetY(), v.GetZ()];
    },
    push: (a, b, c) => {
      torque.Set(a, b, c);
      made.AddTorque(torque);
    },
    step: () => scene.Step(top.h, 1),
  };
}
