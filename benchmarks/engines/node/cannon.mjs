// cannon-es, in double precision; its solver of joints iterates to a tolerance of zero here.

export function body(top) {
  const cannon = top.require("cannon-es");
  const vector = (parts) => new cannon.Vec3(...parts);
  const world = new cannon.World({ gravity: vector([0.0, 0.0, top.gravity]) });
  world.solver.tolerance = 0.0;
  const [w, x, y, z] = top.attitude;
  const made = new cannon.Body({
    mass: 1.0, linearDamping: 0.0, angularDamping: 0.0, allowSleep: false, position: vector(top.place),
    velocity: vector(top.speed), quaternion: new cannon.Quaternion(x, y, z, w), angularVelocity: vector(top.velocity),
  });
  made.inertia.set(...top.moments);
  made.invInertia.set(...top.moments.map((moment) => 1.0 / moment));
  world.addBody(made);
  made.updateInertiaWorld(true);
  if (top.pinned) {
    const base = new cannon.Body({ mass: 0.0 });
    world.addBody(base);
    const tail = vector([0.0, 0.0, -top.arm]);
    world.addConstraint(new cannon.PointToPointConstraint(made, tail, base, vector([0.0, 0.0, 0.0]), 1e9));
  }
  return {
    state: () => {
      const { quaternion: q, angularVelocity: v } = made;
      return [q.w, q.x, q.y, q.z, v.x, v.y, v.z];
    },
    push: (a, b, c) => made.torque.set(a, b, c),
    step: () => world.step(top.h),
  };
}
