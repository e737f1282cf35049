// Filters the matrix and unfolds renderers into their releases. The page is whole without it.
const table = document.getElementById("matrix");
const data = JSON.parse(document.getElementById("releases").textContent);
const [search, state, release, shown] = ["search", "state", "release", "shown"].map((id) => document.getElementById(id));
const rows = [...table.querySelectorAll("tr[data-text]")];
const buttons = [...table.tHead.rows[0].cells].slice(1).map((head) => head.querySelector("button"));
// A column is a release: its renderer's number, its own number, the newest being 0, its head and its cells.
const columns = [...table.tHead.rows[0].cells].slice(1).map((head, renderer) =>
  ({ renderer, number: 0, head, cells: rows.map((row) => row.cells[renderer + 1]) }));
const built = new Set(), open = new Set();

function element(name, text, of = {}) {
  return Object.assign(document.createElement(name), { textContent: text }, of);
}

/** A cell of an older release, from the data. */
function olderCell(renderer, number, k) {
  const { name, slug, releases, cells } = data.renderers[renderer];
  const code = cells[number - 1][k];
  const text = data.texts[code >> 1], changed = (code & 1) === 1;
  const cell = document.createElement("td");
  if (text === "") return cell;
  const [key, sign] = data.states[Number(text[0])];
  const [headline, fault] = text.slice(1).split("\n");
  cell.className = `s-${key}${changed ? " changed" : ""}`;
  cell.dataset.renderer = `${name} ${releases[number][0]}`;
  const link = element("a", "", { className: "cell", href: `renderers/${slug}/${data.capabilities[k]}.html#${releases[number][1]}` });
  const mark = element("span", sign, { className: "sign" });
  mark.ariaHidden = "true";
  link.append(mark, ` ${headline}`);
  if (fault) link.append(element("span", fault, { className: "why" }));
  if (changed) link.append(element("span", "changed from the release before", { className: "since" }));
  cell.append(link);
  return cell;
}

/** Puts the older releases of a renderer behind its newest one. */
function build(renderer) {
  if (built.has(renderer)) return;
  built.add(renderer);
  const { slug, releases } = data.renderers[renderer];
  let before = columns.findIndex((column) => column.renderer === renderer);
  for (let number = 1; number < releases.length; number += 1) {
    const head = element("th", "", { scope: "col", className: "older" });
    head.append(element("a", releases[number][0], { href: `renderers/${slug}/index.html#${releases[number][1]}` }));
    const column = { renderer, number, head, cells: rows.map((_, k) => olderCell(renderer, number, k)) };
    columns[before].head.after(head);
    columns[before].cells.forEach((cell, k) => cell.after(column.cells[k]));
    columns.splice(before += 1, 0, column);
  }
}

/** The choice of releases: all of each, all of a renderer, or one. */
function chosen() {
  if (release.value === "" || release.value === "all") return { all: release.value === "all" };
  const [slug, anchor] = release.value.split("@");
  const renderer = data.renderers.findIndex((of) => of.slug === slug);
  const number = anchor === undefined ? null : data.renderers[renderer].releases.findIndex((of) => of[1] === anchor);
  return { renderer, number };
}

function apply() {
  const { all, renderer: only, number } = chosen();
  data.renderers.forEach((_, k) => { if (all || k === only || open.has(k)) build(k); });
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  const names = data.renderers.map((of) => of.name.toLowerCase());
  const ofNames = words.filter((word) => names.some((name) => name.includes(word)));
  const others = words.filter((word) => !ofNames.includes(word));
  for (const column of columns) {
    const isNamed = ofNames.length === 0 || ofNames.some((word) => names[column.renderer].includes(word));
    const isUnfolded = column.number === 0 || all || open.has(column.renderer) || column.renderer === only;
    const isChosen = only === undefined || (column.renderer === only && (number === null || column.number === number));
    column.shows = isNamed && isChosen && isUnfolded;
    column.head.hidden = !column.shows;
  }
  let count = 0;
  rows.forEach((row, k) => {
    let has = false;
    for (const { cells, shows } of columns) {
      const is = state.value === "" || cells[k].classList.contains(`s-${state.value}`);
      cells[k].hidden = !shows;
      cells[k].classList.toggle("other", !is);
      has ||= is && shows;
    }
    row.hidden = !has || !others.every((word) => row.dataset.text.includes(word));
    count += row.hidden ? 0 : 1;
  });
  for (const body of table.tBodies) body.hidden = ![...body.rows].some((row) => row.dataset.text && !row.hidden);
  for (const group of table.querySelectorAll(".group th")) group.colSpan = columns.length + 1;
  buttons.forEach((button, k) => button?.setAttribute("aria-expanded", String(Boolean(all || k === only || open.has(k)))));
  const visible = columns.filter((column) => column.shows);
  const renderers = new Set(visible.map((column) => column.renderer)).size;
  shown.textContent = `${count} of ${rows.length} capabilities, ${renderers} of ${names.length} renderers, ${visible.length} releases`;
}

function keep() {
  const kept = new URLSearchParams();
  if (search.value) kept.set("q", search.value);
  if (state.value) kept.set("state", state.value);
  if (release.value) kept.set("release", release.value);
  if (open.size > 0) kept.set("open", [...open].map((k) => data.renderers[k].slug).join(","));
  history.replaceState(null, "", `#${kept}`);
  apply();
}

function restore() {
  const kept = new URLSearchParams(location.hash.slice(1));
  const known = (select, value) => ([...select.options].some((option) => option.value === value) ? value : "");
  search.value = kept.get("q") ?? "";
  state.value = known(state, kept.get("state"));
  release.value = known(release, kept.get("release"));
  open.clear();
  const slugs = (kept.get("open") ?? "").split(",");
  data.renderers.forEach((of, k) => { if (slugs.includes(of.slug)) open.add(k); });
  apply();
}

/** The list of releases. */
function list() {
  release.append(element("option", "all of each", { value: "all" }));
  for (const { name, slug, releases } of data.renderers) {
    const group = element("optgroup", "", { label: name });
    if (releases.length > 1) group.append(element("option", `all of ${name}`, { value: slug }));
    for (const [label, anchor] of releases) group.append(element("option", `${name} ${label}`, { value: `${slug}@${anchor}` }));
    release.append(group);
  }
}

list();
buttons.forEach((button, k) => button?.addEventListener("click", () => {
  const isOpen = button.getAttribute("aria-expanded") === "true";
  if (isOpen) open.delete(k); else open.add(k);
  // A choice of releases would open it again.
  if (isOpen && release.value !== "") release.value = "";
  keep();
}));
search.addEventListener("input", keep);
state.addEventListener("change", keep);
release.addEventListener("change", keep);
addEventListener("hashchange", restore);
restore();
