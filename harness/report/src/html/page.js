"use strict";
// Filters, sorts and opens what the page already holds; without it the page is still whole.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const [WORDS, METER, PLACE, VALUE, REFERENCE, DEVIATION, RELATIVE, ALLOWED, PARTS, UNIT, NORMALIZED, COLOUR,
    COMBINED, EXPANDED, FACTOR, PROBABILITY] = Array(16).keys();
  const [CASE, ENGINE, BASIS, SOURCE, DIAGNOSIS, VERDICT] = Array(6).keys();
  const row = (tr) => data.rows[tr.dataset.row];
  const word = (r, which) => data.words[r[WORDS][which]];
  const element = (name, text, attributes = {}) => {
    const made = document.createElement(name);
    if (text != null) made.textContent = text;
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  };

  // Light and dark: what the system says, until the button says otherwise.
  const button = document.querySelector(".theme");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (document.documentElement.dataset.theme || (dark.matches ? "dark" : "light")) === "dark";
  const name = () => { button.textContent = isDark() ? "Light" : "Dark"; };
  button.addEventListener("click", () => { document.documentElement.dataset.theme = isDark() ? "light" : "dark"; name(); });
  dark.addEventListener("change", name);
  name();

  // Tables of readings.
  const severity = ["missing", "unexpected pass", "fail", "undecided", "known deviation", "not judged", "pass"];
  const keys = {
    e: (r) => word(r, ENGINE), c: (r) => word(r, CASE), m: (r) => r[METER], v: (r) => r[VALUE], r: (r) => r[REFERENCE],
    b: (r) => word(r, BASIS), d: (r) => r[RELATIVE], s: (r) => r[NORMALIZED], x: (r) => severity.indexOf(word(r, VERDICT)),
  };
  const order = (a, b) => {
    if (a == null || b == null) return (a == null) - (b == null);
    return typeof a === "string" ? a.localeCompare(b, "en", { numeric: true }) : a - b;
  };

  class Readings {
    constructor(box) {
      this.box = box;
      this.form = box.querySelector("form");
      this.body = box.querySelector("tbody");
      this.rows = [...this.body.rows];
      this.first = Number(box.dataset.first);
      this.all = box.querySelector(".all");
      this.shown = box.querySelector(".shown");
      this.order = "the worst first";
      this.form.addEventListener("input", () => this.update());
      this.form.addEventListener("submit", (event) => event.preventDefault());
      this.form.addEventListener("reset", () => setTimeout(() => this.update()));
      this.all?.addEventListener("click", () => {
        const pressed = this.all.getAttribute("aria-pressed") !== "true";
        this.all.setAttribute("aria-pressed", pressed);
        this.all.textContent = pressed ? "Show fewer" : "Show all";
        this.update();
      });
      for (const head of box.querySelectorAll(".sort")) head.addEventListener("click", () => this.sort(head));
    }

    field(filter) { return this.form.querySelector(`[data-filter=${filter}]`); }

    wanted() {
      const boxes = [...this.form.querySelectorAll("[data-filter=engine]")];
      const engines = new Set(boxes.filter((b) => b.checked).map((b) => b.value));
      const of = (filter) => this.field(filter)?.value ?? "";
      const [which, basis, verdict, meter] = [of("case"), of("basis"), of("verdict"), of("meter").trim().toLowerCase()];
      return (r) => engines.has(word(r, ENGINE)) && (!which || word(r, CASE) === which) && (!basis || word(r, BASIS) === basis)
        && (!verdict || word(r, VERDICT) === verdict) && (!meter || `${r[METER]} ${r[PLACE]}`.toLowerCase().includes(meter));
    }

    update() {
      const wanted = this.wanted();
      const limit = this.all?.getAttribute("aria-pressed") === "true" ? Infinity : this.first;
      let matching = 0;
      for (const tr of this.rows) {
        const matches = wanted(row(tr));
        matching += matches;
        tr.hidden = !matches || matching > limit;
      }
      this.shown.textContent = `${Math.min(matching, limit)} of ${matching} readings, ${this.order}`;
    }

    sort(head) {
      const th = head.closest("th");
      const down = th.getAttribute("aria-sort") === "ascending";
      for (const other of this.box.querySelectorAll("th[aria-sort]")) other.removeAttribute("aria-sort");
      th.setAttribute("aria-sort", down ? "descending" : "ascending");
      const key = keys[head.dataset.key];
      this.rows.sort((a, b) => (down ? -1 : 1) * order(key(row(a)), key(row(b))));
      this.body.append(...this.rows);
      this.order = `by ${head.textContent}`;
      this.update();
    }

    show(cell) {
      this.box.closest("details.fold")?.setAttribute("open", "");
      this.form.reset();
      for (const box of this.form.querySelectorAll("[data-filter=engine]")) box.checked = box.value === cell.engine;
      for (const filter of ["case", "basis"]) if (this.field(filter)) this.field(filter).value = cell[filter];
      setTimeout(() => { this.update(); this.box.scrollIntoView(); this.shown.focus?.(); });
    }
  }
  const tables = new Map([...document.querySelectorAll(".readings")].map((box) => [box.dataset.procedure, new Readings(box)]));

  // The error budget of a reading.
  const digits = (value) => (value == null ? "–" : Number(value.toPrecision(6)).toString().replace("-", "−"));
  const percent = (value) => (value == null ? "–" : `${value < 0 ? "−" : "+"}${Number(Math.abs(100 * value).toPrecision(3))} %`);
  const dialog = document.getElementById("budget");
  const line = (r) => {
    // The deviation with its interval over the tolerance, as a line of numbers.
    const reach = 1.15 * Math.max(r[ALLOWED], Math.abs(r[DEVIATION]) + r[EXPANDED]) || 1;
    const x = (v) => 10 + 240 * (1 + v / reach);
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("viewBox", "0 0 500 56");
    svg.setAttribute("aria-hidden", "true");
    const draw = (kind, attributes, text) => {
      const made = document.createElementNS("http://www.w3.org/2000/svg", kind);
      for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
      if (text) made.textContent = text;
      svg.append(made);
    };
    draw("rect", { class: "band", x: x(-r[ALLOWED]), y: 8, width: x(r[ALLOWED]) - x(-r[ALLOWED]), height: 24, rx: 2 });
    draw("path", { class: "zero", d: `M10 20H490M${x(0)} 6V34` });
    const [low, high] = [r[DEVIATION] - r[EXPANDED], r[DEVIATION] + r[EXPANDED]];
    draw("path", { d: `M${x(low)} 20H${x(high)}`, stroke: `var(--e${r[COLOUR]})`, "stroke-width": 3 });
    draw("circle", { cx: x(r[DEVIATION]), cy: 20, r: 5, fill: `var(--e${r[COLOUR]})` });
    for (const [at, text] of [[-r[ALLOWED], "−"], [r[ALLOWED], "+"]]) {
      draw("text", { x: x(at), y: 48, "text-anchor": "middle", class: "tick" }, `${text}${digits(r[ALLOWED])} ${r[UNIT]}`);
    }
    draw("text", { x: x(0), y: 48, "text-anchor": "middle", class: "tick" }, "0");
    return svg;
  };
  const open = (r) => {
    const unit = r[UNIT];
    const facts = [
      ["place", `${r[METER]}, ${r[PLACE]}`], ["case", word(r, CASE)], ["reading", `${digits(r[VALUE])} ${unit}`],
      ["reference", `${digits(r[REFERENCE])} ${unit} (${word(r, BASIS)})`], ["source", word(r, SOURCE)],
      ["deviation", `${digits(r[DEVIATION])} ${unit} (${percent(r[RELATIVE])})`],
      ["allowed", `± ${digits(r[ALLOWED])} ${unit}`], ["verdict", word(r, VERDICT)], ["why", word(r, DIAGNOSIS)],
      ["p value", r[PROBABILITY] == null ? "" : `${digits(Number(r[PROBABILITY].toPrecision(2)))}: how probable so large a deviation is within the tolerance`],
    ];
    const list = element("dl", null, { class: "facts" });
    for (const [key, value] of facts) if (value) list.append(element("dt", key), element("dd", value));
    const table = element("table", null, { class: "parts" });
    const head = table.createTHead().insertRow();
    head.append(element("th", "component", { scope: "col" }), element("th", `standard uncertainty [${unit}]`, { scope: "col", class: "number" }), element("th", "share of variance", { scope: "col" }));
    const body = table.createTBody();
    for (const [name, u] of r[PARTS]) {
      const share = r[COMBINED] > 0 ? (u / r[COMBINED]) ** 2 : 0;
      const tr = body.insertRow();
      const bar = element("td", null, { class: "share-bar" });
      const fill = element("i", null, { style: `width:${100 * share}%` });
      bar.append(fill, element("span", `${(100 * share).toFixed(0)} %`));
      tr.append(element("td", data.words[name]), element("td", digits(u), { class: "number" }), bar);
    }
    for (const [name, value] of [["combined", r[COMBINED]], [`expanded, k = ${digits(r[FACTOR] && Number(r[FACTOR].toPrecision(3)))}`, r[EXPANDED]]]) {
      const tr = body.insertRow();
      tr.append(element("th", name, { scope: "row" }), element("td", digits(value), { class: "number" }), element("td", r[REFERENCE] && value != null ? `${percent(value / r[REFERENCE]).slice(1)} of the reference` : ""));
    }
    dialog.querySelector("h2").textContent = `${word(r, ENGINE)} at ${r[METER]}`;
    dialog.querySelector(".content").replaceChildren(...(r[DEVIATION] == null ? [] : [line(r)]), list, table);
    dialog.showModal();
  };
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });

  document.addEventListener("click", (event) => {
    const more = event.target.closest(".more");
    const cell = event.target.closest(".open");
    if (more) open(row(more.closest("tr")));
    else if (cell) tables.get(cell.dataset.procedure)?.show(cell.dataset);
  });
  // On paper every setting is unfolded.
  addEventListener("beforeprint", () => { for (const d of document.querySelectorAll("details.printed, details.fold")) d.open = true; });
})();
