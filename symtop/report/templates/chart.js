// Log-log charts to point at: a tooltip for the nearest point, a choice of panel, a filter by family.
// Every chart also exists as a figure; this adds nothing that cannot be read without it.
"use strict";
(() => {
  const sample = document.createElement("template");
  sample.innerHTML = "<svg></svg>";
  const SVG = sample.content.firstChild.namespaceURI;
  const MARKS = { // outlines in a box of two by two around the point
    o: "M-1 0a1 1 0 1 0 2 0a1 1 0 1 0 -2 0z", s: "M-.9-.9H.9V.9H-.9z", "^": "M0-1.1L1 .8H-1z", v: "M0 1.1L1-.8H-1z",
    "<": "M-1.1 0L.8-1V1z", ">": "M1.1 0L-.8-1V1z", D: "M0-1.2L1.2 0L0 1.2L-1.2 0z", d: "M0-1.2L.8 0L0 1.2L-.8 0z",
    P: "M-.4-1.1H.4V-.4H1.1V.4H.4V1.1H-.4V.4H-1.1V-.4H-.4z", X: "M-1-.5L-.5-1L0-.5L.5-1L1-.5L.5 0L1 .5L.5 1L0 .5L-.5 1L-1 .5L-.5 0z",
    p: "M0-1.1L1.05-.34L.65 .9H-.65L-1.05-.34z", h: "M0-1.1L.95-.55V.55L0 1.1L-.95 .55V-.55z",
    H: "M-1.1 0L-.55-.95H.55L1.1 0L.55 .95H-.55z", 8: "M-.45-1.1H.45L1.1-.45V.45L.45 1.1H-.45L-1.1 .45V-.45z",
    "*": "M0-1.3L.3-.4H1.25L.5 .17L.77 1.06L0 .52L-.77 1.06L-.5 .17L-1.25-.4H-.3z", x: "M-1-1L1 1M-1 1L1-1",
  };
  const make = (name, attributes, parent, text) => {
    const node = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text !== undefined) node.textContent = text;
    parent.append(node);
    return node;
  };
  const html = (name, parent, text, kind) => {
    const node = document.createElement(name);
    if (text) node.textContent = text;
    if (kind) node.className = kind;
    parent.append(node);
    return node;
  };
  const power = (value) => {
    const raised = [...String(value)].map((digit) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(digit)]).join("");
    return `10${raised}`;
  };

  const WIDE = 700, LINE = 15; // pixels
  const MOST = 30; // methods that are chosen one by one

  function start(root) {
    const chart = JSON.parse(root.querySelector("script").textContent);
    const panels = Object.keys(chart.panels), titles = chart.choices ?? ["Show"];
    const controls = html("div", root, "", "controls");
    const choose = (title, options, changed) => { // a menu, where there is something to choose
      if (options.length < 2) return;
      const select = html("select", html("label", controls, `${title[0].toUpperCase()}${title.slice(1)} `));
      select.name = title;
      for (const option of options) html("option", select, option).value = option;
      select.addEventListener("change", () => { changed(select.value); draw(); });
    };
    const parts = panels[0].split(" | ");
    if (titles.length !== parts.length) parts.splice(0, parts.length, panels[0]);
    titles.forEach((title, place) => {
      const options = [...new Set(panels.map((one) => (titles.length > 1 ? one.split(" | ")[place] : one)))];
      choose(title, options, (value) => { parts[place] = value; });
    });
    const axes = {}; // the name of each axis and its place in a point
    for (const [key, place] of [["x", 0], ["y", 1]]) {
      const columns = typeof chart[key] === "string" ? { [chart[key]]: place } : chart[key];
      const set = (name) => { axes[key] = [name, columns[name]]; };
      set(Object.keys(columns)[0]);
      choose(key === "x" ? "Cost" : "Error", Object.keys(columns), set);
    }
    const every = panels.flatMap((one) => chart.panels[one]), method = (one) => one.name.split("[")[0];
    const named = new Set(every.map(method)).size <= MOST;
    const kind = (one) => (named ? method(one) : one.family); // few methods are chosen one by one, many by family
    const kinds = [...new Set(every.map(kind))], shown = new Set(kinds);
    const fold = html("details", controls), filter = (html("summary", fold, named ? "Methods" : "Families"), html("fieldset", fold));
    html("legend", filter, "Drawn");
    for (const one of kinds) {
      const label = html("label", filter);
      const box = html("input", label);
      box.type = "checkbox";
      box.checked = true;
      box.value = one;
      label.append(` ${one}`);
      box.addEventListener("change", () => { if (box.checked) shown.add(one); else shown.delete(one); draw(); });
    }
    const frame = html("div", root, "", "frame");
    const tip = html("div", frame, "", "tip");
    tip.setAttribute("role", "status");
    tip.hidden = true;
    const key = html("p", root, "Dotted, vertical: exact motion, no integrator. Grey: below the bound of the truth.", "key");
    const zeros = html("p", root, "", "key");
    let places = [];

    function draw() {
      frame.querySelector("svg")?.remove();
      tip.hidden = true;
      const panel = parts.join(" | "), [xName, xAt] = axes.x, [yName, yAt] = axes.y;
      const there = (point) => point[xAt] > 0 && point[yAt] > 0;
      const chosen = chart.panels[panel].filter((one) => shown.has(kind(one)));
      const series = chosen
        .map((one) => ({ ...one, points: one.points.filter(there).map((point) => [point[xAt], point[yAt], point.at(-1)]) }))
        .filter((one) => one.points.length);
      const first = xAt === 0 && yAt === (typeof chart.y === "string" ? 1 : Object.values(chart.y)[0]);
      const mark = first ? chart.marks?.[panel] : undefined;
      key.hidden = !mark;
      const exact = chosen.filter((one) => one.points.length && one.points.every((point) => point[yAt] === 0)).map((one) => one.name);
      zeros.textContent = exact.length ? `Exactly zero, and so without a point: ${exact.join(", ")}.` : "";
      const svg = make("svg", { tabindex: 0, role: "group", "aria-roledescription": "chart", "aria-label": `${chart.title}: ${panel}, ${yName} against ${xName}; arrow keys go from point to point` }, frame);
      const width = Math.max(280, frame.clientWidth), beside = named && width > WIDE; // names stand at the right, if there is room, or below
      const longest = Math.max(0, ...series.map((one) => {
        const text = make("text", {}, svg, one.name), length = text.getComputedTextLength();
        text.remove();
        return length;
      }));
      const [left, right, top, bottom] = [58, beside ? longest + 8 : 12, 12, 46];
      const height = Math.max(320, Math.min(390, 0.5 * width), beside ? top + bottom + LINE * series.length : 0);
      const columns = Math.max(1, Math.floor(width / (longest + 32))), lines = named && !beside ? Math.ceil(series.length / columns) : 0;
      const whole = height + LINE * lines;
      svg.setAttribute("viewBox", `0 0 ${width} ${whole}`);
      places = [];
      const all = series.flatMap((one) => one.points);
      if (!all.length) {
        make("text", { x: width / 2, y: height / 2, "text-anchor": "middle" }, svg, "no method that is chosen has a point here");
        return;
      }
      const range = (k) => {
        const logs = [...all.map((point) => Math.log10(point[k])), ...(mark ? [Math.log10(mark[k])] : [])];
        return [Math.floor(Math.min(...logs)), Math.max(Math.floor(Math.min(...logs)) + 1, Math.ceil(Math.max(...logs)))];
      };
      const [x0, x1] = range(0), [y0, y1] = range(1);
      const px = (x) => left + (Math.log10(x) - x0) / (x1 - x0) * (width - left - right);
      const py = (y) => height - bottom - (Math.log10(y) - y0) / (y1 - y0) * (height - top - bottom);
      const every = (low, high, room) => Math.max(1, Math.ceil((high - low) / Math.max(2, Math.floor(room))));
      for (let k = x0; k <= x1; k += every(x0, x1, (width - left) / 60)) {
        make("line", { x1: px(10 ** k), x2: px(10 ** k), y1: top, y2: height - bottom, class: "grid" }, svg);
        make("text", { x: px(10 ** k), y: height - bottom + 17, "text-anchor": "middle" }, svg, power(k));
      }
      for (let k = y0; k <= y1; k += every(y0, y1, (height - top) / 34)) {
        make("line", { x1: left, x2: width - right, y1: py(10 ** k), y2: py(10 ** k), class: "grid" }, svg);
        make("text", { x: left - 6, y: py(10 ** k) + 4, "text-anchor": "end" }, svg, power(k));
      }
      make("text", { x: (left + width - right) / 2, y: height - 8, "text-anchor": "middle" }, svg, xName);
      make("text", { transform: `translate(13 ${(top + height - bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, svg, yName);
      if (mark) {
        const low = Math.min(py(mark[1]), height - bottom);
        make("rect", { x: left, width: width - left - right, y: low, height: height - bottom - low, class: "below" }, svg);
        make("line", { x1: px(mark[0]), x2: px(mark[0]), y1: top, y2: height - bottom, class: "exact" }, svg);
      }
      const outline = (one, x, y) => make("path", {
        d: MARKS[one.marker] ?? MARKS.o, transform: `translate(${x.toFixed(1)} ${y.toFixed(1)}) scale(3.6)`,
        fill: one.marker === "x" ? "none" : one.color, stroke: one.color, "stroke-width": 0.3,
      }, svg);
      for (const one of series) {
        const path = one.points.map(([x, y], k) => `${k ? "L" : "M"}${px(x).toFixed(1)} ${py(y).toFixed(1)}`).join("");
        make("path", { d: path, fill: "none", stroke: one.color, "stroke-width": 1.4, ...(one.dashed ? { "stroke-dasharray": "5 3" } : {}) }, svg);
        for (const [x, y, words] of one.points) {
          outline(one, px(x), py(y)).setAttribute("class", "mark");
          places.push([px(x), py(y), one, words]);
        }
      }
      const ends = series.map((one) => ({ one, x: px(one.points.at(-1)[0]), y: py(one.points.at(-1)[1]) })).sort((a, b) => a.y - b.y);
      if (lines) {
        for (const [k, { one }] of ends.entries()) {
          const [x, y] = [10 + Math.floor(k / lines) * (width / columns), height + LINE * ((k % lines) + 0.5)];
          outline(one, x, y);
          make("text", { x: x + 10, y: y + 4 }, svg, one.name);
        }
      }
      if (beside) {
        let place = top;
        for (const end of ends) end.at = place = Math.max(place + LINE, end.y);
        for (let k = ends.length - 1, most = height - bottom; k >= 0; k -= 1, most -= LINE) ends[k].at = Math.min(ends[k].at, most);
        const over = (end, x) => end.y + (end.at - end.y) * (x - end.x) / (width - right - end.x);
        const cross = (a, b) => (over(a, Math.max(a.x, b.x)) - over(b, Math.max(a.x, b.x))) * (a.at - b.at) < 0;
        for (let found = true; found;) { // two names change places where their lines cross, and these get shorter
          found = false;
          for (const a of ends) for (const b of ends) if (cross(a, b)) [a.at, b.at, found] = [b.at, a.at, true];
        }
        for (const { one, x, y, at } of ends) {
          make("path", { d: `M${x} ${y}L${width - right} ${at}`, stroke: one.color, "stroke-width": 0.5, fill: "none" }, svg);
          make("text", { x: width - right + 4, y: at + 4, style: `fill: ${one.ink}` }, svg, one.name);
        }
      }
      const ring = make("circle", { r: 8, fill: "none", stroke: "#1b1f24", "stroke-width": 1.5, visibility: "hidden" }, svg);
      const show = (best) => {
        tip.hidden = !best;
        ring.setAttribute("visibility", best ? "visible" : "hidden");
        if (!best) return;
        ring.setAttribute("cx", best[0]);
        ring.setAttribute("cy", best[1]);
        tip.textContent = `${best[2].name} (${best[2].family}): ${best[3]}`;
        const box = svg.getBoundingClientRect(), side = best[0] * box.width / width;
        tip.style.left = side > box.width / 2 ? "auto" : `${side + 12}px`;
        tip.style.right = side > box.width / 2 ? `${box.width - side + 12}px` : "auto";
        tip.style.top = `${best[1] * box.height / whole + 8}px`;
      };
      const point = (event) => {
        const box = svg.getBoundingClientRect();
        const [mx, my] = [(event.clientX - box.left) * width / box.width, (event.clientY - box.top) * whole / box.height];
        let best = null, least = 30 ** 2;
        for (const place of places) {
          const away = (place[0] - mx) ** 2 + (place[1] - my) ** 2;
          if (away < least) [best, least] = [place, away];
        }
        show(best);
      };
      let at = -1;
      svg.addEventListener("keydown", (event) => {
        const next = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: places.length - 1 }[event.key];
        if (event.key === "Escape") show(null);
        if (next === undefined) return;
        at = (next + places.length) % places.length;
        show(places[at]);
        event.preventDefault();
      });
      svg.addEventListener("blur", () => show(null));
      svg.addEventListener("pointermove", point);
      svg.addEventListener("pointerdown", point);
      svg.addEventListener("pointerleave", () => show(null));
    }
    const figure = root.previousElementSibling; // the same runs as a picture, for print and without this script
    if (figure?.localName === "figure") {
      figure.querySelector(".scroll").classList.add("repeated");
      figure.querySelector("figcaption").before(root);
    }
    draw();
    let last = frame.clientWidth;
    new ResizeObserver(() => { if (frame.clientWidth !== last) { last = frame.clientWidth; draw(); } }).observe(frame);
  }
  for (const root of document.querySelectorAll(".chart")) start(root);
})();
