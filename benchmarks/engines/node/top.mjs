// node top.mjs ENGINE FOLDER SETTING HELD I1 I3 mgl qw qx qy qz wx wy wz h steps
//
// Steps a top in an engine of npm that is installed in FOLDER, and prints a line "qw qx qy qz wx wy wz" for the start
// and for each step. A free body gets the torque mgl k x e of its attitude before each step; on a ball joint the arm
// and the gravity are those of benchmarks/engines/common.py. Doubles are printed so that they can be read back exactly.

import { createRequire } from "node:module";

const [engine, folder, setting, held, ...numbers] = process.argv.slice(2);
const [I1, I3, mgl, qw, qx, qy, qz, wx, wy, wz, h, steps] = numbers.map(Number);
const pinned = held === "ball joint";
const arm = pinned ? 0.1 * Math.sqrt(I1) : 0.0;

function axis([w, x, y, z]) {
  return [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z];
}

function cross([a, b, c], [d, e, f]) {
  return [b * f - c * e, c * d - a * f, a * e - b * d];
}

const attitude = [qw, qx, qy, qz];
const velocity = [wx, wy, wz];
const place = axis(attitude).map((part) => arm * part);
const top = {
  setting, pinned, h, arm, attitude, velocity, place,
  speed: cross(velocity, place), // of the centre
  moments: [I1 - arm * arm, I1 - arm * arm, I3],
  gravity: pinned ? -mgl / arm : 0.0,
  require: createRequire(`${folder}/package.json`),
};

const { body } = await import(`./${engine}.mjs`);
const { state, push, step } = await body(top);
const lines = [];
for (let k = 0; k <= steps; k += 1) {
  const now = state();
  lines.push(now.join(" "));
  if (k < steps) {
    if (!pinned) {
      const e = axis(now);
      push(-mgl * e[1], mgl * e[0], 0.0);
    }
    step();
  }
}
process.stdout.write(`${lines.join("\n")}\n`, () => process.exit(0));
