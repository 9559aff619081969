// Error against run time: a line for each method in logarithms, its name beside it, and the runs of the page as points.

import { surface, ticks, tone } from "./draw.js";

const LEFT = 46, RIGHT = 128, TOP = 10, BOTTOM = 32, LINE = 13;
const DASHES = [[], [5, 2], [2, 2], [8, 2, 2, 2]];  // of lines of one colour

const words = (seconds) => (seconds < 1e-3 ? `${+(seconds * 1e6).toPrecision(2)} us` : seconds < 1 ? `${+(seconds * 1e3).toPrecision(2)} ms` : `${+seconds.toPrecision(2)} s`);

// A name that is too long for the room keeps its beginning and its end.
function cut(context, text, room, half = text.length / 2) {
  const short = half < text.length / 2 ? `${text.slice(0, half)}…${text.slice(-half)}` : text;
  return context.measureText(short).width > room ? cut(context, text, room, Math.ceil(half) - 1) : short;
}

export function drawCost(canvas, { lines, missing }, runs, catalogue) {
  const [context, width, height] = surface(canvas);
  const color = (name) => { const own = catalogue.find((entry) => entry.name === name).color; return own === "#000000" ? tone("ink") : own; };
  const points = runs.filter((one) => one.seconds > 0 && one.error > 0);
  const all = [...lines.flatMap((line) => line.seconds.map((seconds, k) => [seconds, line.error[k]])), ...points.map((one) => [one.seconds, one.error])];
  Object.assign(canvas.dataset, { lines: lines.length, points: points.length, missing });
  if (!all.length) return;
  const span = (place) => { const logs = all.map((pair) => Math.log10(pair[place])); return [Math.min(...logs) - 0.2, Math.max(...logs) + 0.2]; };
  const [west, east] = span(0);
  let [south, north] = span(1);
  south = Math.max(south, -16);
  north = Math.min(north, 0.7);
  const x = (v) => LEFT + ((width - LEFT - RIGHT) * (Math.log10(v) - west)) / (east - west);
  const y = (v) => TOP + ((height - TOP - BOTTOM) * (north - Math.min(Math.max(Math.log10(v), south), north))) / (north - south);
  context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
  context.fillStyle = tone("soft");
  context.strokeStyle = tone("line");
  context.lineWidth = 1;
  context.textBaseline = "middle";
  context.textAlign = "right";
  for (const tick of ticks(south, north, 5, true)) {
    context.beginPath(); context.moveTo(LEFT, y(10 ** tick)); context.lineTo(width - RIGHT, y(10 ** tick)); context.stroke();
    context.fillText(`1e${tick}`, LEFT - 5, y(10 ** tick));
  }
  context.textAlign = "center";
  for (const tick of ticks(west, east, 4, true)) context.fillText(words(10 ** tick), x(10 ** tick), height - BOTTOM + 10);
  context.fillText("time of a run", (LEFT + width - RIGHT) / 2, height - 7);
  const labels = lines.map((line) => ({ ...line, at: line.error.length ? y(line.error[line.error.length - 1]) : height, color: color(line.name) }));
  labels.forEach((label, k) => { label.dash = DASHES[labels.slice(0, k).filter((one) => one.color === label.color).length % DASHES.length]; });
  labels.sort((one, other) => one.at - other.at);
  // Names stand in a column, in the order of the ends of the lines, none on another.
  labels.forEach((label, k) => { label.place = Math.max(label.at, k ? labels[k - 1].place + LINE : TOP + 4); });
  labels.reduceRight((below, label) => (label.place = Math.min(label.place, below - LINE)), height - 2);
  for (const { name, seconds, error, place, failed, dash, color: own } of labels) {
    const shown = runs.some((one) => one.name === name);
    context.strokeStyle = context.fillStyle = own;
    context.lineWidth = shown ? 2.4 : 1.2;
    context.setLineDash(dash);
    context.beginPath();
    context.moveTo(width - RIGHT + 4, place); context.lineTo(width - RIGHT + 18, place);
    seconds.forEach((value, k) => { if (k) context.lineTo(x(value), y(error[k])); else context.moveTo(x(value), y(error[k])); });
    context.stroke();
    context.setLineDash([]);
    seconds.forEach((value, k) => context.fillRect(x(value) - 1.5, y(error[k]) - 1.5, 3, 3));
    context.textAlign = "left";
    context.fillStyle = tone("ink");
    context.font = `${shown ? "bold " : ""}11px system-ui, 'DejaVu Sans', sans-serif`;
    context.fillText(cut(context, seconds.length ? name : `${name}: ${failed} failed`, RIGHT - 22), width - RIGHT + 22, place);
  }
  for (const { seconds, error, color: own } of points) {
    context.fillStyle = own;
    context.strokeStyle = tone("ink");
    context.lineWidth = 1.5;
    context.beginPath();
    context.arc(x(seconds), y(error), 6, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
}
