// The map of outcomes: step across, spin upward, each cell one run; a click or the arrow keys choose a cell.

import { surface, tone, unit } from "./draw.js";

const LEFT = 46, RIGHT = 10, TOP = 8, BOTTOM = 32;
// From an axis error of 1e-6 rad to 1 rad: cividis, which colour-blind eyes and grey prints keep in order.
const SCALE = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"];
const FAILED = "#b3261e";

export class OutcomeMap {
  constructor(canvas, choose) {
    this.canvas = canvas;
    canvas.addEventListener("click", (event) => {
      const box = canvas.getBoundingClientRect();
      this.pick((event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT), 1 - (event.clientY - box.top - TOP) / (box.height - TOP - BOTTOM), choose);
    });
    canvas.addEventListener("keydown", (event) => {
      const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }[event.key];
      if (!move || !this.cells) return;
      event.preventDefault();
      const [across, upward] = this.place(this.at);
      const { columns, rows } = this.cells;
      this.pick(across + move[0] / columns, upward + move[1] / rows, choose);
    });
  }

  // The cell at two shares of the map, and the step and spin at its middle: what the server ran.
  pick(across, upward, choose) {
    if (!this.cells) return;
    const { columns, rows, range } = this.cells;
    const near = (share, count) => Math.min(count - 1, Math.max(0, Math.floor(share * count))) / (count - 1);
    const [i, j] = [near(across, columns), near(upward, rows)];
    choose(+(range.step_least * (range.step_most / range.step_least) ** i).toPrecision(6), +(range.spin_least + j * (range.spin_most - range.spin_least)).toPrecision(6));
  }

  // The shares of the map at which a step and a spin stand: the middle of their cell.
  place({ step, spin }) {
    const { columns, rows, range } = this.cells;
    const i = Math.log(step / range.step_least) / Math.log(range.step_most / range.step_least);
    const j = (spin - range.spin_least) / (range.spin_most - range.spin_least);
    return [(i * (columns - 1) + 0.5) / columns, (j * (rows - 1) + 0.5) / rows];
  }

  draw(at) {
    this.at = at;
    const [context, width, height] = surface(this.canvas);
    if (!this.cells) return;
    const { columns, rows, range, error } = this.cells;
    const [w, h] = [width - LEFT - RIGHT, height - TOP - BOTTOM];
    error.forEach((value, k) => {
      const share = (Math.log10(Math.max(value, 1e-6)) + 6) / 6;
      context.fillStyle = Number.isFinite(value) ? SCALE[Math.min(9, Math.floor(10 * share))] : FAILED;
      const [i, j] = [k % columns, Math.floor(k / columns)];
      context.fillRect(LEFT + (w * i) / columns, TOP + (h * (rows - 1 - j)) / rows, w / columns + 0.5, h / rows + 0.5);
    });
    context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    context.fillStyle = tone("soft");
    context.textBaseline = "middle";
    context.textAlign = "left";
    context.fillText(`${+range.step_least.toPrecision(2)}`, LEFT, height - BOTTOM + 10);
    context.textAlign = "right";
    context.fillText(`${+range.step_most.toPrecision(2)}`, width - RIGHT, height - BOTTOM + 10);
    context.fillText(`${+range.spin_most.toPrecision(3)}`, LEFT - 5, TOP + 6);
    context.fillText(`${+range.spin_least.toPrecision(3)}`, LEFT - 5, TOP + h - 6);
    context.textAlign = "center";
    context.fillText(`step${unit(" (s)")}, logarithmic`, LEFT + w / 2, height - 7);
    const [across, upward] = this.place(at);
    if (across < 0 || across > 1 || upward < 0 || upward > 1) return;
    for (const [color, line] of [["#000000", 4], ["#ffffff", 2]]) {
      context.strokeStyle = color;
      context.lineWidth = line;
      context.strokeRect(LEFT + w * across - 5, TOP + h * (1 - upward) - 5, 10, 10);
    }
  }
}
