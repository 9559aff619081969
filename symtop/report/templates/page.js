// The page around the findings: its scheme of colours, contents that follow the reader, tables to search and download.
// Without it every word, table and figure is still there.
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
    const id = (ended ? sections.at(-1) : read.at(-1) ?? sections[0]).id;
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
  function download(table) {
    const lines = [...table.rows].map((row) => [...row.cells].map((cell) => quoted(cell.textContent.trim())).join(","));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`${lines.join("\r\n")}\r\n`], { type: "text/csv" }));
    link.download = `${table.dataset.name}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
  const FEW = 14; // rows that are found by looking
  for (const table of document.querySelectorAll("table[data-name]")) {
    const region = table.parentElement, rows = [...table.tBodies[0].rows];
    const bar = document.createElement("div");
    bar.className = "controls tools";
    if (rows.length > FEW) {
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
      bar.append(search, count);
    }
    const save = document.createElement("button");
    save.type = "button";
    save.textContent = "CSV";
    save.setAttribute("aria-label", `Download ${region.getAttribute("aria-label")} as CSV`);
    save.addEventListener("click", () => download(table));
    bar.append(save);
    if (rows.length > FEW) region.before(bar); else region.after(bar);
  }
})();
