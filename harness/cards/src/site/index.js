// Filters the matrix. The page is whole without it.
const table = document.getElementById("matrix");
const [search, state, release, shown] = ["search", "state", "release", "shown"].map((id) => document.getElementById(id));
const heads = [...table.tHead.rows[0].cells].slice(1);
const rows = [...table.querySelectorAll("tr[data-text]")];
function apply() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  const names = heads.map((head) => head.dataset.name);
  const ofNames = words.filter((word) => names.some((name) => name.includes(word)));
  const others = words.filter((word) => !ofNames.includes(word));
  const columns = names.map((name) => ofNames.length === 0 || ofNames.some((word) => name.includes(word)));
  heads.forEach((head, k) => { head.hidden = !columns[k]; });
  let count = 0;
  for (const row of rows) {
    let has = false;
    [...row.cells].slice(1).forEach((cell, k) => {
      const is = state.value === "" || cell.classList.contains("s-" + state.value);
      cell.hidden = !columns[k];
      cell.classList.toggle("other", !is);
      has ||= is && columns[k];
    });
    row.hidden = !has || !others.every((word) => row.dataset.text.includes(word));
    count += row.hidden ? 0 : 1;
  }
  for (const body of table.tBodies) body.hidden = ![...body.rows].some((row) => row.dataset.text && !row.hidden);
  shown.textContent = `${count} of ${rows.length} capabilities, ${columns.filter(Boolean).length} of ${names.length} renderers`;
}
function keep() {
  const kept = new URLSearchParams();
  if (search.value) kept.set("q", search.value);
  if (state.value) kept.set("state", state.value);
  history.replaceState(null, "", "#" + kept);
  apply();
}
function restore() {
  const kept = new URLSearchParams(location.hash.slice(1));
  search.value = kept.get("q") ?? "";
  state.value = [...state.options].some((option) => option.value === kept.get("state")) ? kept.get("state") : "";
  apply();
}
search.addEventListener("input", keep);
state.addEventListener("change", keep);
release.addEventListener("change", () => { if (release.value) location.href = release.value; });
addEventListener("hashchange", restore);
restore();
