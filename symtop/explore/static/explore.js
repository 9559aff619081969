// Controls, requests to the server, and the animation.

import { Sphere, plot, tone, unit } from "./draw.js";
import { drawCost } from "./cost.js";
import { OutcomeMap } from "./map.js";
import { portrait } from "./portrait.js";
import { STORIES } from "./stories.js";

const $ = (id) => document.getElementById(id);
// name, label with its unit, least, most of the slider, logarithmic; a rate's slider spans twice the scene's own value
const TOP = [["I1", "I1 (kg m²)", 0.01, 20, true], ["I2", "I2 (kg m²)", 0.01, 20, true], ["I3", "I3 (kg m²)", 0.01, 20, true], ["mgl", "mgl (N m)", -40, 160, false]];
const START = [
  ["theta", "theta (rad)", 0.01, 3.13, false], ["phi", "phi (rad)", -3.1416, 3.1416, false], ["psi", "psi (rad)", -3.1416, 3.1416, false],
  ["w1", "rate w1 (rad/s)", -3, 3, false], ["w2", "rate w2 (rad/s)", -3, 3, false], ["w3", "rate w3 (rad/s)", -3, 3, false],
  ["theta_dot", "theta' (rad/s)", -2, 2, false], ["phi_dot", "phi' (rad/s)", -5, 5, false], ["psi_dot", "psi' (rad/s)", -10, 10, false],
];
const SETTINGS = [["step_size", "step (s)", 1e-5, 1, true], ["tolerance", "tolerance", 1e-13, 1e-2, true], ["horizon", "time (s)", 0.5, 500, true]];
const OSCILLATOR = [["friction", "friction b", 0, 4, false], ["oscillator_step", "oscillator step (s)", 0.0025, 2.5, true]];
const DAMPED = {  // the path of a question: the names that it depends on, and the curves of its answer
  oscillator: { of: ["friction", "oscillator_step"], curves: { midpoint: "#0072b2", trapezoidal: "#e69f00", guess: "#cc79a7" } },
  "damped-top": { of: ["friction", "step_size", "horizon", ...[...TOP, ...START].map(([name]) => name)], curves: { midpoint: "#0072b2" } },
};
const PLOTS = ["axis_error", "attitude_error", "energy", "p_phi", "p_psi"];

const values = {};
const rows = {};
const sphere = new Sphere($("sphere"));
const outcomes = new OutcomeMap($("map"), (step, spin) => { rows.step_size.set(step); rows.psi_dot.set(spin); edited("start"); ask(); });
let costs = null, costed = "", mapping = false, patient;
let catalogue, run = null, second = null, mapped = "", place = 0, playing = !matchMedia("(prefers-reduced-motion: reduce)").matches, asking = false, stale = false, drawnAt = -1;

function control([name, label, least, most, logarithmic], group) {
  const row = document.createElement("div");
  row.className = "slider";
  const [words, slider, number] = ["label", "input", "input"].map((tag) => document.createElement(tag));
  words.htmlFor = number.id = name;
  slider.id = `${name}-slider`;
  const inUnits = () => { words.textContent = label.replace(/ \((kg m²|N m|rad\/s|s)\)/, unit("$&")); slider.setAttribute("aria-label", words.textContent); };
  number.type = "number";
  number.step = "any";
  slider.type = "range";
  const forth = (v) => (logarithmic ? Math.log10(v) : v);
  const back = (v) => (logarithmic ? 10 ** v : v);
  Object.assign(slider, { min: forth(least), max: forth(most), step: "any" });
  row.append(words, slider, number);
  $(group).append(row);
  const show = (value) => { number.value = +value.toPrecision(6); slider.value = forth(value); };
  slider.addEventListener("input", () => { values[name] = +back(+slider.value).toPrecision(6); number.value = values[name]; changed(group); });
  number.addEventListener("change", () => { values[name] = number.value === "" ? null : +number.value; slider.value = forth(values[name]); changed(group); });
  const span = (value) => { if (/_dot$|^w\d$/.test(name)) Object.assign(slider, { min: Math.min(least, -2 * Math.abs(value)), max: Math.max(most, 2 * Math.abs(value)) }); };
  inUnits();
  rows[name] = { row, inUnits, set: (value) => { values[name] = value; span(value); show(value); } };
}

// Friction is no part of the run.
function changed(group) {
  if (group === "friction-controls") { keep(); askDamped(); } else { edited(group); ask(); }
}

// A top or a start that was changed is no longer the scene's, and the page and the run say so.
function edited(group) {
  if (group === "settings") return;
  const option = $("scene").selectedOptions[0];
  option.text = `${option.value} (edited)`;
  values.scene = `${option.value}-edited`;
  $("reset").disabled = false;
}

const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;
const ofBody = () => document.body.classList.contains("a-body");  // a body without symmetry, and no top
const errorOf = (largest) => largest[ofBody() ? "attitude_error" : "axis_error"];

function chosen() {
  return catalogue.integrators.find((entry) => entry.name === values.integrator);
}

function chooseScene(name) {
  const entry = catalogue.scenes.find((scene) => scene.name === name);
  $("purpose").textContent = entry.purpose;
  for (const option of $("scene").options) option.text = option.value;
  values.scene = name;
  $("reset").disabled = true;
  document.body.classList.toggle("a-body", "I2" in entry);
  document.body.classList.toggle("si", entry.units === "SI");
  for (const row of Object.values(rows)) row.inUnits();
  for (const [key] of [...TOP, ...START]) {
    rows[key].row.hidden = !(key in entry);
    if (key in entry) rows[key].set(entry[key]); else values[key] = null;
  }
  for (const option of document.querySelectorAll("#integrator option, #second option")) option.disabled = ofBody() && !(catalogue.integrators.find((one) => one.name === option.value) || { of_body: true }).of_body;
  for (const [id, other] of [["second", ""], ["integrator", "rk4"]]) if ($(id).selectedOptions[0].disabled) $(id).value = other;
  values.second = $("second").value;
  if ($("integrator").value !== values.integrator) chooseIntegrator($("integrator").value);
  rows.horizon.set(entry.horizon);
  rows.step_size.set(+(lasting(entry) / 60).toPrecision(2));
  place = 0;
  outcomes.cells = null;  // of another scene
  mapped = $("map-note").textContent = "";
  ask();
}

// A nutation of a scene, or its run where that is shorter.
const lasting = ({ period, horizon }) => Math.min(period || horizon, horizon);

// A map's ranges: steps from 1/200 to 1/2 of the scene's nutation and at most the run, spins up to twice the scene's own.
function mapRange() {
  const entry = catalogue.scenes.find((scene) => scene.name === $("scene").value);
  const [scale, most] = [lasting(entry), 2 * Math.max(1, Math.abs(entry.psi_dot))];
  return { step_least: scale / 200, step_most: Math.min(scale / 2, values.horizon), spin_least: -most, spin_most: most };
}

function chooseStory(name) {
  const story = STORIES[name];
  $("watch").textContent = story ? story.watch : "";
  if (!story) return;
  $("scene").value = story.scene;
  chooseScene(story.scene);
  $("integrator").value = story.integrator;
  $("second").value = values.second = story.second;
  chooseIntegrator(story.integrator);
  rows.step_size.set(story.step_size);
  ask();
}

// The whole state stands in the fragment of the address: a link restores it.
function keep() {
  history.replaceState(null, "", `#${new URLSearchParams(Object.entries({ ...values, base: $("scene").value }).filter(([, value]) => value !== null && value !== ""))}`);
}

function restore(fragment) {
  if (fragment.length < 2) return false;
  const first = { base: catalogue.scenes[0].name, integrator: catalogue.integrators[0].name };
  const kept = { ...first, ...Object.fromEntries(new URLSearchParams(fragment.slice(1))) };
  const entry = catalogue.scenes.find((scene) => scene.name === kept.base);
  $("story").value = "";
  chooseStory("");
  if (!entry || !catalogue.integrators.some((one) => one.name === kept.integrator)) {
    $("watch").textContent = `The link is not followed: ${entry ? `the integrator ${kept.integrator}` : `the scene ${kept.base}`} is not known here.`;
    return false;
  }
  $("scene").value = kept.base;
  chooseScene(kept.base);
  $("integrator").value = kept.integrator;
  $("second").value = kept.second || "";
  values.second = $("second").value;  // nothing, of a method that is not known here
  chooseIntegrator(kept.integrator);
  for (const [name, row] of Object.entries(rows)) if (name in kept && values[name] !== null && Number.isFinite(+kept[name])) row.set(+kept[name]);
  if ([...TOP, ...START].some(([name]) => name in entry && values[name] !== entry[name])) edited("start");
  ask();
  return true;
}

function chooseIntegrator(name) {
  const other = name !== values.integrator;
  values.integrator = name;
  const { summary, chart, control, tolerance } = chosen();
  $("summary").textContent = `${summary} (shown in the ${ofBody() ? "body" : chart} chart)`;
  const controls = [control, values.second && catalogue.integrators.find((entry) => entry.name === values.second).control];
  for (const name of ["step_size", "tolerance"]) rows[name].row.hidden = !controls.includes(name);
  if (other && control === "tolerance") rows.tolerance.set(tolerance);
  ask();
}

async function post(path, changes) {
  return fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ ...values, base: $("scene").value, ...changes }) });
}

// What an answer is of: one of another scene or method than the page's own is not shown.
const subject = () => [$("scene").value, values.integrator, values.second].join();

// What the lines of the costs are of.
const motion = () => JSON.stringify([...TOP, ...START, ["horizon"]].map(([name]) => values[name]));

// One request at a time; changes made meanwhile lead to one more, with the newest values.
async function ask() {
  if (asking) { stale = true; return; }
  asking = true;
  const began = performance.now(), about = subject();
  const patience = setTimeout(() => {
    $("status").textContent = `${values.integrator}: computing; the first run of a method takes longer, because it is compiled`;
  }, 400);
  try {
    keep();
    const asked = [post("run"), values.second && post("run", { integrator: values.second })];
    const [answer, other] = await Promise.all(asked.map(async (one) => one && (await one).json()));
    clearTimeout(patience);
    const refused = answer.error || (other && other.error);
    if (about !== subject()) stale = true;
    else if (refused) refuse(refused);
    else { show(answer, other, began); if (!stale) askMap(); }
  } catch {
    clearTimeout(patience);
    refuse("the explorer's server does not answer; is symtop explore still running?");
  }
  asking = false;
  if (stale) { stale = false; ask(); }
}

// The map is asked for when something else than its own two axes has changed, and then the costs, as both may have to be
// compiled: meanwhile runs are answered.
async function askMap() {
  if (mapping) return;
  if (ofBody()) { clearTimeout(patient); patient = setTimeout(askCost, 300); return; }
  const range = mapRange();
  const question = JSON.stringify({ ...values, ...range, scene: "", step_size: 0, psi_dot: 0, tolerance: 0, second: "", friction: 0, oscillator_step: 0 });
  clearTimeout(patient);
  if (question === mapped) { patient = setTimeout(askCost, 300); return; }
  mapping = true;
  const name = values.integrator, scene = $("scene").value;
  const response = await post("map", range).catch(() => null);  // `ask` says that nobody answers
  const answer = response && await response.json().catch(() => null);
  mapping = false;
  if (!answer) return;
  if (scene !== $("scene").value) { askMap(); return; }
  mapped = question;
  outcomes.cells = answer.error ? null : { ...answer, range, error: unpack(answer.error_rad) };
  $("map-note").textContent = answer.error || `${name}, ${answer.columns * answer.rows} runs, ${answer.failed} ended early, ${(+answer.cells_a_second.toPrecision(2)).toLocaleString("en")} runs a second`;
  outcomes.draw({ step: values.step_size, spin: values.psi_dot });
  document.body.dataset.maps = +(document.body.dataset.maps || 0) + 1;
  askMap();
}

// Lines are measured while the page is used, their times together: it asks again until they are there.
async function askCost() {
  clearTimeout(patient);
  if (document.hidden) { patient = setTimeout(askCost, 1000); return; }
  const question = costed = JSON.stringify(values), of = motion();
  const response = await post("cost").catch(() => null);  // `ask` says that nobody answers
  if (!response || question !== costed) return;
  const answer = await response.json();
  costs = answer.error ? null : { ...answer, of };
  const bad = answer.error ? [answer.error] : answer.lines.filter((line) => line.message).map((line) => `${line.name}: ${line.message}`);
  $("cost-note").textContent = [...bad, ...(answer.missing ? [answer.missing === 1 ? "1 method is being measured" : `${answer.missing} methods are being measured`] : [])].join("; ");
  drawPlots();
  document.body.dataset.costs = answer.error ? "refused" : answer.lines.length;
  if (answer.missing) patient = setTimeout(askCost, 700);
}

// The damped oscillator by both rules of its discrete Lagrangian with the notebook's guess, and the damped top.
const askDamped = () => Object.keys(DAMPED).forEach(askOneDamped);

async function askOneDamped(name) {
  if (ofBody() && name === "damped-top") return;
  const one = DAMPED[name], question = JSON.stringify(one.of.map((key) => values[key]));
  if (one.asking || question === one.answered) return;
  one.asking = true;
  const response = await post(name).catch(() => null);
  const answer = response ? await response.json() : { error: "the explorer's server does not answer" };
  one.asking = false;
  one.answered = response && question;
  one.arrays = answer.error ? null : Object.fromEntries(Object.entries(answer.arrays).map(([key, text]) => [key, unpack(text)]));
  const entry = (words, color) => { const mark = document.createElement("b"); mark.className = "swatch"; mark.style.borderColor = color; mark.textContent = words; return [mark, " "]; };
  const key = $(`${name}-key`);
  key.replaceChildren(...(answer.error ? [answer.error] : Object.entries(one.curves).flatMap(([curve, color]) => entry(curve in answer.largest ? `${curve}, off by ${answer.largest[curve].toExponential(1)}` : "the notebook's guess at the force", color))), answer.message || "");
  drawPlots();
  key.dataset.answers = +(key.dataset.answers || 0) + 1;
  if (response) askOneDamped(name);  // with what was changed meanwhile
}

function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

function refuse(sentence) {
  $("status").textContent = sentence;
  $("status").className = "failed";
  $("warnings").replaceChildren();
  $("other").hidden = true;  // of the run before
  $("netcdf").disabled = $("script").disabled = true;
  document.body.dataset.answer = "refused";
}

// The half sides of a homogeneous brick with the moments of the page, half a diagonal of 0.8 in all, and its middle axis.
function brick() {
  const moments = [values.I1, values.I2, values.I3], all = moments.reduce((sum, one) => sum + one);
  const sides = moments.map((one) => Math.sqrt(Math.max(0, all - 2 * one))), size = Math.hypot(...sides);
  return { sides: sides.map((side) => Math.max(0.04, (0.8 * side) / size)), middle: moments.indexOf([...moments].sort((one, other) => one - other)[1]) };
}

function unpacked(answer, name) {
  const arrays = Object.fromEntries(Object.entries(answer.arrays).map(([key, text]) => [key, unpack(text)]));
  const last = arrays.time.length - 1;
  const trail = answer.period ? Math.ceil((8 * answer.period * last) / arrays.time[last]) : last;
  const swing = answer.period ? (values.I1 * 2 * Math.PI * Math.PI) / (180 * answer.period) : 1e-3;  // p_theta of a nutation by a degree
  const { sides, middle } = ofBody() ? brick() : {};
  return { ...arrays, trail, swing, sides, shown: middle ?? 2, name, place: (of) => (of / (run.time.length - 1)) * last, degrees: arrays.theta.map((value) => (value * 180) / Math.PI), color: catalogue.integrators.find((entry) => entry.name === name).color };
}

function show(answer, other, began) {
  const before = run && run.time.length > 1 ? place / (run.time.length - 1) : 0;
  run = unpacked(answer, values.integrator);
  second = other ? unpacked(other, values.second) : null;
  const taken = second && second.color === run.color;
  for (const one of [run, second]) if (one) { const own = one.color; Object.defineProperty(one, "color", { get: () => ((one === second && taken) || own === "#000000" ? tone("ink") : own) }); }
  $("sphere").classList.toggle("pair", Boolean(second && run.sides));
  run.width = Math.min(0.6, 0.42 * Math.sqrt(values.I3 / values.I1));
  const last = run.time.length - 1;
  run.trueTheta = Array.from({ length: last + 1 }, (_, k) => {
    const [w, x, y, z] = run.truth.subarray(4 * k, 4 * k + 4);
    return (2 * Math.atan2(Math.hypot(x, y), Math.hypot(w, z)) * 180) / Math.PI;
  });
  place = before * last;
  for (const name of PLOTS) {
    const largest = answer.largest[name];
    $(`largest-${name}`).textContent = largest == null ? "" : largest === 0 ? "always zero" : `largest ${largest.toExponential(1)}`;
  }
  const many = answer.steps_per_nutation, a = many ? `, ${many < 10 ? +many.toPrecision(2) : Math.round(many)} a ${ofBody() ? "natural period" : "nutation"}` : "";
  $("status").textContent = `${values.integrator}: ${answer.message}; ${counted(answer.steps, "step")}${a}, ${counted(answer.force_evaluations, "force evaluation")}, ${answer.run_ms.toFixed(0)} ms`;
  $("status").className = answer.outcome === "ok" ? "" : "failed";
  $("other").hidden = !other;
  if (other) {
    $("other").textContent = `${values.second}: ${other.message}; largest ${ofBody() ? "attitude" : "axis"} error ${errorOf(other.largest) === null ? "unknown" : errorOf(other.largest).toExponential(1)} rad`;
    $("other").className = other.outcome === "ok" ? "" : "failed";
  }
  for (const [id, name, one] of [["swatch-1", values.integrator, run], ["swatch-2", values.second, second]]) {
    $(id).hidden = !one;
    $(id).textContent = name;
  }
  $("warnings").replaceChildren(...[...answer.warnings, ...(other ? other.warnings : [])].map((sentence) => {
    const item = document.createElement("li");
    item.textContent = sentence;
    return item;
  }));
  $("netcdf").disabled = $("script").disabled = false;
  run.error = answer.outcome === "ok" ? errorOf(answer.largest) : null;
  if (second) second.error = other.outcome === "ok" ? errorOf(other.largest) : null;
  if (costs) costs = costs.of === motion() ? { ...costs, seconds: [] } : { lines: [], seconds: [] };  // not those of before
  clearTimeout(patient);
  askDamped();
  drawPlots();
  Object.assign(document.body.dataset, {
    answer: answer.outcome, answers: +(document.body.dataset.answers || 0) + 1, steps: answer.steps,
    server: answer.all_ms.toFixed(1), elapsed: (performance.now() - began).toFixed(1),
  });
}

const beside = (name) => (second ? [{ values: second[name], time: second.time, color: second.color, dash: [6, 3] }] : []);

function drawPlots() {
  if (!run) return;
  const now = run.time[Math.round(place)] || 0;
  plot($("plot-theta"), run.time, [{ values: run.trueTheta, color: "#9a9a9a", dash: [2, 3] }, { values: run.degrees, color: run.color }, ...beside("degrees")], false, now);
  if (run.middle) plot($("plot-middle"), run.time, [{ values: run.true_middle, color: "#9a9a9a", dash: [2, 3] }, { values: run.middle, color: run.color }, ...beside("middle")], false, now);
  for (const name of PLOTS) if (run[name]) plot($(`plot-${name}`), run.time, [{ values: run[name], color: run.color }, ...beside(name)], true, now);
  for (const [id, one] of [["swatch-1", run], ["swatch-2", second]]) if (one) $(id).style.borderColor = one.color;
  if (costs) drawCost($("cost"), costs, [run, second].flatMap((one, k) => (one ? [{ name: k ? values.second : values.integrator, seconds: costs.seconds[k], error: one.error, color: one.color }] : [])), catalogue.integrators);
  for (const [name, { arrays, curves }] of Object.entries(DAMPED)) if (arrays) plot($(`plot-${name}`), arrays.time, [{ values: arrays.exact, time: arrays.exact_time, color: "#9a9a9a", dash: [2, 3] }, ...Object.entries(curves).map(([curve, color]) => ({ values: arrays[curve], color }))], false, NaN);
  if (run.true_theta) {  // and not of the body that was shown before
    portrait($("portrait"), second ? [run, second] : [run]);
    outcomes.draw({ step: values.step_size, spin: values.psi_dot });
  }
  drawnAt = performance.now();
}

let before = performance.now();
function frame(instant) {
  const passed = Math.min(0.1, (instant - before) / 1000);
  before = instant;
  if (run) {
    const last = run.time.length - 1;
    const speed = last / Math.min(run.time[last], 40);  // the whole run in real time, a long one in forty seconds
    if (playing) place = place + passed * speed > last ? 0 : place + passed * speed;
    place = Math.min(place, last);
    $("clock").value = place / last;
    $("now").textContent = `${run.time[Math.round(place)].toFixed(2)}${unit(" s")}`;
    sphere.draw(run, place, second);
    if (playing && instant - drawnAt > 100) drawPlots();
  }
  requestAnimationFrame(frame);
}

async function save(path, name) {
  const response = await post(path);
  if (!response.ok) { refuse((await response.json()).error); return; }
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await response.blob());
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

async function begin() {
  catalogue = await (await fetch("catalogue")).json();
  for (const entry of TOP) control(entry, "top");
  for (const entry of START) control(entry, "start");
  for (const entry of SETTINGS) control(entry, "settings");
  for (const entry of OSCILLATOR) control(entry, "friction-controls");
  for (const { name } of catalogue.scenes) $("scene").append(new Option(name, name));
  for (const family of new Set(catalogue.integrators.map((entry) => entry.family))) {
    const group = document.createElement("optgroup");
    group.label = family;
    for (const entry of catalogue.integrators) if (entry.family === family) group.append(new Option(entry.name, entry.name));
    $("integrator").append(group);
    $("second").append(group.cloneNode(true));
  }
  for (const name of Object.keys(STORIES)) $("story").append(new Option(name, name));
  $("story").addEventListener("change", () => chooseStory($("story").value));
  $("second").addEventListener("change", () => { values.second = $("second").value; chooseIntegrator(values.integrator); });
  $("sphere").addEventListener("keydown", (event) => {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowDown: [0, 0.1], ArrowUp: [0, -0.1] }[event.key];
    if (turn) { event.preventDefault(); sphere.turn(...turn); }
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawPlots);
  window.addEventListener("hashchange", (event) => restore(new URL(event.newURL).hash));  // an answer may have changed the address since
  $("scene").addEventListener("change", () => { $("story").value = ""; chooseStory(""); chooseScene($("scene").value); });
  $("reset").addEventListener("click", () => { if ($("story").value) chooseStory($("story").value); else chooseScene($("scene").value); });
  $("integrator").addEventListener("change", () => chooseIntegrator($("integrator").value));
  $("clock").addEventListener("input", () => { place = $("clock").value * (run ? run.time.length - 1 : 0); playing = false; $("play").textContent = "Play"; drawPlots(); });
  $("play").addEventListener("click", () => { playing = !playing; $("play").textContent = playing ? "Pause" : "Play"; });
  $("netcdf").addEventListener("click", () => save("netcdf", "explored.nc"));
  $("script").addEventListener("click", () => save("script", "explored.py"));
  window.addEventListener("resize", drawPlots);
  if (!playing) $("play").textContent = "Play";
  rows.tolerance.set(1e-6);
  rows.friction.set(0.1);
  rows.oscillator_step.set(0.5);
  values.integrator = catalogue.integrators[0].name;
  values.second = "";
  if (!restore(location.hash)) { chooseScene(catalogue.scenes[0].name); chooseIntegrator(values.integrator); }
  askDamped();
  requestAnimationFrame(frame);
}

begin().catch((error) => refuse(`the explorer cannot start: ${error.message}`));
