// The phase portrait of the reduced motion: p_theta against theta, the exact curve and the orbits of the methods.

import { surface, ticks, tone } from "./draw.js";

const LEFT = 46, RIGHT = 10, TOP = 8, BOTTOM = 32;
const DEGREE = 180 / Math.PI;

export function portrait(canvas, runs) {
  const [context, width, height] = surface(canvas);
  const { true_theta: theta, true_p_theta: momentum } = runs[0];
  // The window follows the exact curve: an orbit that leaves it is cut at the border, which is what one is to see.
  const span = (values, least) => {
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const pad = Math.max(0.6 * (high - low), least);
    return [low - pad, high + pad];
  };
  let [west, east] = span(theta.map((v) => v * DEGREE), 1);
  west = Math.max(west, 0);
  east = Math.min(east, 180);
  const [south, north] = span(momentum, runs[0].swing);
  const x = (v) => LEFT + ((width - LEFT - RIGHT) * (v - west)) / (east - west);
  const y = (v) => TOP + ((height - TOP - BOTTOM) * (north - v)) / (north - south);
  context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
  context.fillStyle = tone("soft");
  context.strokeStyle = tone("line");
  context.textBaseline = "middle";
  context.textAlign = "right";
  for (const tick of ticks(south, north, 4, false)) {
    context.beginPath(); context.moveTo(LEFT, y(tick)); context.lineTo(width - RIGHT, y(tick)); context.stroke();
    context.fillText(`${+tick.toPrecision(3)}`, LEFT - 5, y(tick));
  }
  context.textAlign = "center";
  for (const tick of ticks(west, east, 5, false)) context.fillText(`${+tick.toPrecision(4)}`, x(tick), height - BOTTOM + 10);
  context.fillText("theta (degrees)", (LEFT + width - RIGHT) / 2, height - 7);
  context.save();
  context.beginPath();
  context.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
  context.clip();
  runs.forEach((run, second) => {
    context.fillStyle = context.strokeStyle = run.color;
    context.lineWidth = 1;
    for (let k = 0; k < run.theta.length; k++) {
      const [px, py] = [x(run.theta[k] * DEGREE), y(run.p_theta[k])];
      if (!Number.isFinite(px + py)) continue;
      if (second) context.strokeRect(px - 2, py - 2, 4, 4); else context.fillRect(px - 1.2, py - 1.2, 2.4, 2.4);
    }
  });
  context.strokeStyle = tone("ink");
  context.lineWidth = 1.2;
  context.setLineDash([3, 3]);
  context.beginPath();
  theta.forEach((v, k) => { if (k) context.lineTo(x(v * DEGREE), y(momentum[k])); else context.moveTo(x(v * DEGREE), y(momentum[k])); });
  context.stroke();
  context.restore();
}
