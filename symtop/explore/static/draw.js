// Drawing on canvases: the unit sphere with the turning triad, and small plots over time.

const TRIAD = ["#d55e00", "#009e73", "#0072b2"];
const GHOST = "#9a9a9a";
const FLOOR = 1e-17;

// A colour of the style sheet, which follows the light or dark scheme.
export const tone = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// A unit, of a scene in SI units; nothing of any other.
export const unit = (words) => (document.body.classList.contains("si") ? words : "");

// A canvas scaled to the screen's own pixels; returns its context and its size in page units.
export function surface(canvas) {
  const box = canvas.getBoundingClientRect();
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(1, Math.round(box.width * ratio));
  const height = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, box.width, box.height);
  return [context, box.width, box.height];
}

// The body axes in space, from a unit quaternion (w, x, y, z) that turns body vectors into space vectors.
export function bodyAxes(w, x, y, z) {
  return [
    [w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z],
  ];
}

// The attitude between two samples: the straight line from one quaternion to the nearer sign of the next, made unit.
export function attitudeAt(samples, place) {
  const last = samples.length / 4 - 1;
  const k = Math.min(Math.floor(place), last);
  const next = Math.min(k + 1, last);
  const share = place - k;
  let dot = 0;
  for (let i = 0; i < 4; i++) dot += samples[4 * k + i] * samples[4 * next + i];
  const sign = dot < 0 ? -1 : 1;
  const mixed = [0, 1, 2, 3].map((i) => (1 - share) * samples[4 * k + i] + sign * share * samples[4 * next + i]);
  const size = Math.hypot(...mixed);
  return mixed.map((value) => value / size);
}

export class Sphere {
  constructor(canvas) {
    this.canvas = canvas;
    this.azimuth = -0.96;
    this.elevation = 0.38;
    let held = null;
    canvas.addEventListener("pointerdown", (event) => {
      held = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointercancel", () => { held = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      this.azimuth -= 0.008 * (event.clientX - held[0]);
      this.elevation = Math.min(1.55, Math.max(-1.55, this.elevation + 0.008 * (event.clientY - held[1])));
      held = [event.clientX, event.clientY];
    });
  }

  // Right and up on the screen, and depth towards the eye.
  project(point) {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    const near = ca * point[0] + sa * point[1];
    return [-sa * point[0] + ca * point[1], ce * point[2] - se * near, ce * near + se * point[2]];
  }

  // Keys turn the view as the mouse does.
  turn(right, up) {
    this.azimuth -= right;
    this.elevation = Math.min(1.55, Math.max(-1.55, this.elevation - up));
  }

  // A top with the path of the second method beside it; of bodies two, each with its name.
  draw(run, place, second) {
    const [context, width, height] = surface(this.canvas);
    const shown = run && run.sides && second ? [run, second] : [run];
    const scale = 0.46 * Math.min(width / shown.length, height);
    this.context = context;
    context.lineJoin = context.lineCap = "round";
    const circle = Array.from({ length: 73 }, (_, k) => [Math.cos((k * Math.PI) / 36), Math.sin((k * Math.PI) / 36)]);
    shown.forEach((one, n) => {
      const middle = (width * (n + 0.5)) / shown.length;
      this.at = (point) => {
        const [x, y, depth] = this.project(point);
        return [middle + scale * x, height / 2 - scale * y, depth];
      };
      context.fillStyle = tone("tint");
      context.strokeStyle = tone("line");
      context.lineWidth = 1;
      context.beginPath();
      context.arc(middle, height / 2, scale, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
      [[1, 2], [0, 2], [0, 1]].forEach(([i, j], k) => {
        this.line(circle.map(([c, s]) => { const p = [0, 0, 0]; p[i] = c; p[j] = s; return p; }), TRIAD[k], 0.8, 0.55, true);
      });
      if (!one) return;
      const here = one === second ? second.place(place) : place;
      this.path(one.truth, here, GHOST, 2.2, [2, 4], one);
      this.path(one.attitude, here, one.color, 1.4, [], one);
      if (second && shown.length === 1) this.path(second.attitude, second.place(place), second.color, 1.8, [7, 4], second);
      this.rods(attitudeAt(one.truth, here), true);
      const now = attitudeAt(one.attitude, here);
      if (now.every(Number.isFinite)) {
        if (one.sides) this.brick(now, one.sides, one.color); else this.body(now, one.width, one.color);
        this.rods(now, false);
      }
      if (shown.length === 1) return;
      context.fillStyle = tone("ink");
      context.font = "bold 13px system-ui, 'DejaVu Sans', sans-serif";
      context.textAlign = "center";
      context.fillText(one.name, middle, height - 4);
    });
  }

  // A body as the brick of its moments, the far faces first.
  brick(attitude, sides, color) {
    const { context } = this, axes = bodyAxes(...attitude);
    const point = (signs) => [0, 1, 2].map((i) => signs.reduce((sum, sign, k) => sum + sign * sides[k] * axes[k][i], 0));
    const faces = [0, 1, 2].flatMap((k) => [-1, 1].map((sign) => [[-1, -1], [-1, 1], [1, 1], [1, -1]].map(([one, other]) => {
      const signs = [0, 0, 0];
      signs[k] = sign; signs[(k + 1) % 3] = one; signs[(k + 2) % 3] = other;
      return this.at(point(signs));
    })));
    const depth = (face) => face.reduce((sum, corner) => sum + corner[2], 0);
    context.fillStyle = context.strokeStyle = color;
    context.lineWidth = 1.2;
    for (const face of faces.sort((one, other) => depth(one) - depth(other))) {
      context.beginPath();
      face.forEach(([x, y], n) => { if (n) context.lineTo(x, y); else context.moveTo(x, y); });
      context.closePath();
      context.globalAlpha = 0.22;
      context.fill();
      context.globalAlpha = 0.9;
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  // The top as a cone on its point, as wide as its inertia says; every third sector is darker, so that it is seen to spin.
  body(attitude, width, color) {
    const [first, second, third] = bodyAxes(...attitude);
    const rim = Array.from({ length: 25 }, (_, k) => {
      const [c, s] = [width * Math.cos((k * Math.PI) / 12), width * Math.sin((k * Math.PI) / 12)];
      return [0, 1, 2].map((i) => 0.72 * third[i] + c * first[i] + s * second[i]);
    });
    const { context } = this;
    context.fillStyle = color;
    rim.slice(1).forEach((point, k) => {
      for (const tip of [[0, 0, 0], third.map((value) => 0.78 * value)]) {
        context.globalAlpha = k % 6 < 2 ? 0.3 : 0.12;
        context.beginPath();
        [tip, rim[k], point].forEach((corner, n) => { const [x, y] = this.at(corner); if (n) context.lineTo(x, y); else context.moveTo(x, y); });
        context.fill();
      }
    });
    context.globalAlpha = 1;
    this.line(rim, color, 1.2, 0.8, false);
  }

  line(points, color, width, alpha, closed) {
    const { context } = this;
    context.globalAlpha = alpha;
    context.strokeStyle = context.fillStyle = color;
    context.lineWidth = width;
    context.beginPath();
    points.forEach((point, k) => { const [x, y] = this.at(point); if (k) context.lineTo(x, y); else context.moveTo(x, y); });
    context.stroke();
    if (closed) { context.globalAlpha = 0.04; context.fill(); }
    context.globalAlpha = 1;
  }

  path(samples, place, color, width, dash, { trail, shown }) {
    const { context } = this;
    const end = Math.floor(place);
    context.setLineDash(dash);
    context.strokeStyle = color;
    context.lineWidth = width;
    for (const front of [false, true]) {
      context.globalAlpha = front ? 0.95 : 0.35;
      context.beginPath();
      let pen = false;
      for (let k = Math.max(0, end - trail); k <= end; k++) {
        const [w, x, y, z] = samples.subarray(4 * k, 4 * k + 4);
        const [px, py, depth] = this.at(bodyAxes(w, x, y, z)[shown]);
        if (!Number.isFinite(px) || depth >= 0 !== front) { pen = false; continue; }
        if (pen) context.lineTo(px, py); else context.moveTo(px, py);
        pen = true;
      }
      context.stroke();
    }
    context.globalAlpha = 1;
    context.setLineDash([]);
  }

  rods(attitude, ghost) {
    const { context } = this;
    const axes = bodyAxes(...attitude).map((tip, k) => ({ tip, color: ghost ? GHOST : TRIAD[k] }));
    axes.sort((one, other) => this.project(one.tip)[2] - this.project(other.tip)[2]);
    const [x0, y0] = this.at([0, 0, 0]);
    for (const { tip, color } of axes) {
      const [x, y] = this.at(tip);
      context.strokeStyle = context.fillStyle = color;
      context.lineWidth = ghost ? 1.6 : 5;
      context.beginPath();
      context.moveTo(x0, y0);
      context.lineTo(x, y);
      context.stroke();
      context.beginPath();
      context.arc(x, y, ghost ? 3 : 6, 0, 2 * Math.PI);
      context.fill();
    }
  }
}

const LEFT = 46, RIGHT = 8, TOP = 6, BOTTOM = 20;

// A plot of curves over time, each over its own `time` if it has one; `logarithmic` draws absolute values, nothing below rounding.
export function plot(canvas, time, curves, logarithmic, now) {
  const [context, width, height] = surface(canvas);
  const shown = curves.map((curve) => (logarithmic ? Array.from(curve.values, (v) => Math.log10(Math.max(Math.abs(v), FLOOR))) : curve.values));
  let low = Infinity, high = -Infinity;
  for (const values of shown) for (const v of values) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(low <= high)) { low = logarithmic ? -17 : 0; high = logarithmic ? 0 : 1; }
  if (logarithmic) {
    high = Math.ceil(high);
    low = Math.min(high - 3, Math.max(Math.floor(low), high - 8));  // every residual begins at zero: eight decades are enough
    shown.forEach((values) => values.forEach((v, k) => { if (v < low) values[k] = low; }));
  } else {
    const pad = 0.06 * (high - low) + 2e-3 * Math.max(Math.abs(low), Math.abs(high)) + 1e-9;  // what four digits tell apart
    low -= pad;
    high += pad;
  }
  const end = time[time.length - 1] || 1;
  const x = (t) => LEFT + ((width - LEFT - RIGHT) * t) / end;
  const y = (v) => TOP + ((height - TOP - BOTTOM) * (high - v)) / (high - low);
  context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
  context.fillStyle = tone("soft");
  context.strokeStyle = tone("line");
  context.lineWidth = 1;
  for (const tick of ticks(low, high, 4, logarithmic)) {
    context.beginPath(); context.moveTo(LEFT, y(tick)); context.lineTo(width - RIGHT, y(tick)); context.stroke();
    context.textAlign = "right"; context.textBaseline = "middle";
    context.fillText(logarithmic ? `1e${tick}` : `${+tick.toPrecision(4)}`, LEFT - 5, y(tick));
  }
  context.textAlign = "center"; context.textBaseline = "top";
  for (const tick of ticks(0, end, 5, false)) context.fillText(`${+tick.toPrecision(4)}`, Math.min(x(tick), width - 22), height - BOTTOM + 5);
  context.textAlign = "right";
  context.fillText(unit("s"), width - 1, height - BOTTOM + 5);
  shown.forEach((values, k) => {
    context.strokeStyle = curves[k].color;
    context.lineWidth = 1.4;
    context.setLineDash(curves[k].dash || []);
    const own = curves[k].time || time;
    context.beginPath();
    let pen = false;
    for (let i = 0; i < values.length; i++) {
      if (!Number.isFinite(values[i])) { pen = false; continue; }
      if (pen) context.lineTo(x(own[i]), y(values[i])); else context.moveTo(x(own[i]), y(values[i]));
      pen = true;
    }
    context.stroke();
  });
  context.setLineDash([]);
  context.strokeStyle = tone("ink");
  context.lineWidth = 0.8;
  context.beginPath(); context.moveTo(x(now), TOP); context.lineTo(x(now), height - BOTTOM); context.stroke();
}

export function ticks(low, high, count, whole) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  let step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough) || rough;
  if (whole) step = Math.max(1, Math.ceil(rough));
  const values = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) values.push(k * step);
  return values;
}
