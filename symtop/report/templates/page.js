// The page around the findings: its scheme of colours, contents that follow the reader, tables to search, sort and download.
// Without it every word and figure is still there, and every table is a CSV beside the page.
"use strict";
(() => {
  const root = document.documentElement;
  const narrow = matchMedia("(max-width: 64rem)"), dark = matchMedia("(prefers-color-scheme: dark)");

  const button = document.getElementById("scheme");
  const scheme = () => root.dataset.scheme || (dark.matches ? "dark" : "light");
  const label = () => { button.textContent = scheme() === "dark" ? "Light" : "Dark"; button.setAttribute("aria-label", `${button.textContent} colours`); };
  button.hidden = false;
  button.addEventListener("click", () => {
    root.dataset.scheme = scheme() === "dark" ? "light" : "dark";
    try { localStorage.setItem("symtop-scheme", root.dataset.scheme); } catch { /* no storage: for this visit only */ }
    label();
  });
  dark.addEventListener("change", label);
  label();

  const contents = document.querySelector("details.contents");
  const links = new Map([...contents.querySelectorAll("a")].map((link) => [link.hash.slice(1), link]));
  const folded = () => { contents.open = !narrow.matches; };
  narrow.addEventListener("change", folded);
  folded();
  contents.addEventListener("click", (event) => { if (event.target.closest("a") && narrow.matches) contents.open = false; });
  const sections = [...document.querySelectorAll("main > section")].filter((section) => links.has(section.id));
  let current = "";
  const follow = () => {
    const read = sections.filter((section) => section.getBoundingClientRect().top < 0.25 * innerHeight);
    const ended = innerHeight + scrollY >= root.scrollHeight - 2;
    const id = (scrollY < 2 ? sections[0] : ended ? sections.at(-1) : read.at(-1) ?? sections[0]).id;
    if (id === current) return;
    links.get(current)?.removeAttribute("aria-current");
    const link = links.get(current = id), list = contents.parentElement;
    link.setAttribute("aria-current", "location");
    const top = link.offsetTop - list.offsetTop; // scrollIntoView would also move the page
    if (top < list.scrollTop || top + link.offsetHeight > list.scrollTop + list.clientHeight) list.scrollTop = top - 0.4 * list.clientHeight;
  };
  let waiting = false;
  const soon = () => {
    if (!waiting) requestAnimationFrame(() => { waiting = false; follow(); });
    waiting = true;
  };
  addEventListener("scroll", soon, { passive: true });
  addEventListener("resize", soon);
  follow();

  // A link into a fold opens it.
  const unfold = () => {
    let node = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (const target = node; node; node = node.parentElement) {
      if (node.localName === "details" && !node.open) { node.open = true; target.scrollIntoView(); }
    }
  };
  addEventListener("hashchange", unfold);
  unfold();

  const quoted = (cell) => (/[",\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell);
  const plain = (text) => text.replace(/^(?:(.+)\s×\s)?(-?)10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)$/, // a power of ten as a program reads it
    (_, factor, minus, raised) => `${minus}${factor ?? 1}e${[...raised].map((digit) => "-0123456789"["⁻⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(digit)]).join("")}`);
  function download(table) {
    const lines = [...table.rows].map((row) => [...row.cells].map((cell) => quoted(plain(cell.textContent.trim()))).join(","));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`${lines.join("\r\n")}\r\n`], { type: "text/csv" }));
    link.download = `${table.dataset.name}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
  function sortable(table) {
    const body = table.tBodies[0];
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const down = head.getAttribute("aria-sort") === "ascending", sign = down ? -1 : 1;
        for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        const text = (row) => row.cells[column].textContent.trim();
        const number = (row) => Number(plain(text(row)).replaceAll(",", "").replace(/inf$/, "Infinity")); // as Python writes it
        const words = (row) => Number.isNaN(number(row));
        const order = (a, b) => (words(a) && words(b) ? text(a).localeCompare(text(b)) : (words(a) - words(b)) || number(a) - number(b));
        const rows = [...body.rows]; // numbers, then words, and what is empty last
        rows.sort((a, b) => (!text(a) - !text(b)) || sign * order(a, b));
        body.append(...rows);
      });
    });
  }
  function tools(region, table) {
    const rows = [...table.tBodies[0].rows], bar = document.createElement("div");
    bar.className = "controls tools";
    const search = document.createElement("input"), count = document.createElement("span");
    search.type = "search";
    search.placeholder = "rows with all these words";
    search.setAttribute("aria-label", `Rows of ${region.getAttribute("aria-label")} with all these words`);
    count.setAttribute("role", "status");
    search.addEventListener("input", () => {
      const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      for (const row of rows) {
        const text = row.textContent.toLowerCase();
        row.hidden = !words.every((word) => text.includes(word));
        shown += !row.hidden;
      }
      count.textContent = words.length ? `${shown} of ${rows.length} rows` : "";
    });
    const save = document.createElement("button");
    save.type = "button";
    save.textContent = "CSV";
    save.setAttribute("aria-label", `Download ${region.getAttribute("aria-label")} as CSV`);
    save.addEventListener("click", () => download(table));
    bar.append(search, count, save);
    region.before(bar);
    sortable(table);
  }
  function build(fold) { // a table in full, from its data, when it is first opened
    const { header, rows } = JSON.parse(fold.querySelector("script").textContent), name = fold.dataset.table;
    const region = document.createElement("div"), table = document.createElement("table");
    region.className = "scroll";
    region.tabIndex = 0;
    region.setAttribute("role", "region");
    region.setAttribute("aria-label", `All rows of ${name}`);
    table.dataset.name = name;
    const head = table.createTHead().insertRow();
    for (const text of header) {
      const cell = document.createElement("th");
      cell.scope = "col";
      cell.textContent = text;
      head.append(cell);
    }
    const body = table.createTBody();
    for (const row of rows) {
      const line = body.insertRow();
      for (const text of row) {
        const cell = line.insertCell();
        cell.textContent = text;
        if (text.length > 42) cell.className = "words";
      }
    }
    region.append(table);
    fold.append(region);
    tools(region, table);
  }
  for (const fold of document.querySelectorAll("details.whole")) {
    fold.addEventListener("toggle", () => { if (fold.open && !fold.querySelector("table")) build(fold); });
  }
  const FEW = 15; // rows that are found by looking
  for (const table of document.querySelectorAll("table[data-name]")) {
    if (table.tBodies[0].rows.length > FEW) tools(table.parentElement, table);
  }
})();
