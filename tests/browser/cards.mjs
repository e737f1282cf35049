// Looks at sites of score cards as a reader would: node cards.mjs SITE...; names what is wrong and fails.
import { createRequire } from "node:module";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { existsSync, readdirSync, readFileSync, statSync } from "node:fs";
import { start } from "./chromium.mjs";

// What a first screen may weigh, in bytes.
const MAX_FIRST_SCREEN = 500_000;
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const wrongs = [];
let done = 0;
const check = (place, holds, says) => { done += 1; if (!holds) wrongs.push(`${place}: ${says}`); };

async function accessible(page, place) {
  await page.evaluate(axe);
  const { violations, passes } = await page.evaluate(() => globalThis.axe.run("html", { resultTypes: ["violations"] }));
  for (const v of violations) wrongs.push(`${place}: ${v.id}, ${v.help}: ${v.nodes.slice(0, 3).map((n) => n.target.join(" ")).join("; ")}`);
  check(place, passes.length > 10, "axe found next to nothing to check");
}

// Every page of a site, the reports of runs left out: check.mjs looks at those.
function pages(folder, below = "") {
  return readdirSync(path.join(folder, below), { withFileTypes: true }).flatMap((entry) => {
    const name = path.join(below, entry.name);
    if (entry.isDirectory()) return below === "" && entry.name === "runs" ? [] : pages(folder, name);
    return name.endsWith(".html") ? [name] : [];
  });
}

// Links that lead to no file of the site.
function deadLinks(folder, page) {
  const text = readFileSync(path.join(folder, page), "utf8");
  return [...text.matchAll(/ href="([^"#]+)/g)].map((match) => match[1]).filter((link) => {
    const target = path.resolve(folder, path.dirname(page), decodeURIComponent(link));
    return !target.startsWith(path.resolve(folder) + path.sep) || !existsSync(target);
  });
}

async function filters(page, place) {
  const rows = page.locator("#matrix tr[data-text]:not([hidden])");
  const heads = page.locator("#matrix thead th[data-name]:not([hidden])");
  const [allRows, allHeads] = [await rows.count(), await heads.count()];
  const name = (await heads.last().getAttribute("data-name")).split(/\s+/)[0];
  await page.locator("#search").fill(name);
  check(place, (await heads.count()) < allHeads && (await rows.count()) === allRows, `searching ${name} leaves ${await heads.count()} renderers`);
  await page.reload();
  check(place, (await page.locator("#search").inputValue()) === name && (await heads.count()) < allHeads, "the address does not hold the search");
  await page.locator("#search").fill("no such thing");
  check(place, (await rows.count()) === 0 && (await page.locator("#shown").textContent()).startsWith("0 of"), "a search for nothing finds something");
  await page.locator("#search").fill("");
  await page.locator("#state").selectOption("accurate");
  const shown = await page.locator("#matrix tr[data-text]:not([hidden]) td:not(.other)").evaluateAll((cells) => cells.map((cell) => cell.className));
  check(place, shown.length > 0 && shown.every((name) => name.includes("s-accurate")), `the state shows ${new Set(shown).size} others`);
  await page.locator("#state").selectOption("");
  check(place, (await rows.count()) === allRows && (await heads.count()) === allHeads, "cleared filters leave something out");
}

// Unfolds the first renderer by keyboard, all of them by the list, and one release by its address.
async function releases(page, place) {
  const heads = page.locator("#matrix thead th:not([hidden])");
  const newest = await heads.count();
  const button = page.locator("#matrix thead button").first();
  if ((await button.count()) === 0) return;
  const count = Number.parseInt(await button.textContent(), 10);
  if (await button.isVisible()) {
    await button.focus();
    await page.keyboard.press("Enter");
    check(place, (await button.getAttribute("aria-expanded")) === "true", "the button does not say that it is open");
    check(place, (await heads.count()) === newest + count - 1, `${count} releases unfold into ${(await heads.count()) - newest + 1}`);
    await page.reload();
    check(place, (await heads.count()) === newest + count - 1, "the address does not hold what is unfolded");
    await accessible(page, `${place}, unfolded`);
    await button.focus();
    await page.keyboard.press("Space");
    check(place, (await heads.count()) === newest, "the button does not fold");
  }
  const took = await page.evaluate(() => {
    const list = document.getElementById("release"), began = performance.now();
    list.value = "all";
    list.dispatchEvent(new Event("change"));
    document.body.getBoundingClientRect();
    return performance.now() - began;
  });
  const cells = page.locator("#matrix td:not([hidden]) a.cell");
  console.log(`${place}: all releases unfold in ${Math.round(took)} ms, ${await cells.count()} cells`);
  // Minutes on a large site, and the same markup at every width.
  if (page.viewportSize().width > 1000) await accessible(page, `${place}, all releases`);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  check(place, wide <= page.viewportSize().width, `with all releases it is ${wide} wide`);
  // The last release of the first renderer that has several.
  const last = await page.locator("#release optgroup").evaluateAll((groups) =>
    groups.filter((group) => group.children.length > 2).map((group) => [group.lastElementChild.value, group.lastElementChild.textContent])[0]);
  await page.locator("#release").selectOption(last[0]);
  await page.reload();
  check(place, (await heads.count()) === 2 && page.url().includes("release="), "the address does not hold the release");
  const links = await cells.evaluateAll((found) => found.map((cell) => cell.getAttribute("href")));
  const anchor = last[0].split("@")[1];
  check(place, links.length > 0 && links.every((link) => link.endsWith(`#${anchor}`)), `cells of ${last[1]} lead to ${links[0]}`);
  const dead = links.filter((link) => !existsSync(path.resolve(path.dirname(fileURLToPath(page.url())), link.split("#")[0])));
  check(place, dead.length === 0, `cells of ${last[1]} lead nowhere: ${dead[0]}`);
  await page.locator("#release").selectOption("");
}

async function keyboard(page, place) {
  const cell = page.locator("#matrix a.cell").first();
  const link = await cell.getAttribute("href");
  await cell.focus();
  await Promise.all([page.waitForURL((url) => decodeURIComponent(url.href).endsWith(link)).catch(() => {}), page.keyboard.press("Enter")]);
  check(place, decodeURIComponent(page.url()).endsWith(link), `Enter leads to ${page.url()}, and not to ${link}`);
  check(place, (await page.locator("details[open] table").count()) > 0 || (await page.locator("section.evidence details").count()) === 0, "the evidence is closed");
  await page.goBack();
}

async function print(page, place) {
  await page.emulateMedia({ media: "print" });
  check(place, !(await page.locator("nav").isVisible()) && (await page.locator("#matrix").isVisible()), "paper shows the navigation");
  check(place, (await page.pdf({ format: "A4", landscape: true })).length > 10000, "the printed page is empty");
  await page.emulateMedia({ media: "screen" });
}

const browser = await start();

async function look(folder, file, { width, colorScheme }) {
  const place = `${path.basename(folder)}/${file} ${width} ${colorScheme}`;
  const { page, troubles } = await browser.open(path.resolve(folder, file), { width, colorScheme });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  check(place, wide <= width, `it is ${wide} wide`);
  await page.evaluate(() => { for (const details of document.querySelectorAll("details")) details.open = true; });
  await accessible(page, place);
  if (file === "index.html" && colorScheme === "light") {
    const ready = await page.evaluate(() => performance.getEntriesByType("navigation")[0].domInteractive);
    console.log(`${place}: interactive after ${Math.round(ready)} ms`);
    await filters(page, place);
    await releases(page, place);
    await keyboard(page, place);
    if (width > 1000) await print(page, place);
  }
  check(place, troubles.length === 0, troubles.join("; "));
  await page.context().close();
}

for (const folder of process.argv.slice(2)) {
  const all = pages(folder);
  const weight = statSync(path.join(folder, "index.html")).size;
  check(folder, weight < MAX_FIRST_SCREEN, `the first screen has ${weight} bytes`);
  console.log(`${folder}: ${all.length} pages, the first has ${weight} bytes`);
  for (const page of all) {
    const dead = deadLinks(folder, page);
    check(`${folder}/${page}`, dead.length === 0, `${dead.length} links lead nowhere: ${dead.slice(0, 3).join(", ")}`);
  }
  // The first page, the rule, and of renderers and evidence the first and the last.
  const renderers = all.filter((page) => page.startsWith("renderers") && page.endsWith("index.html"));
  const evidence = all.filter((page) => page.startsWith("renderers") && !page.endsWith("index.html"));
  const some = ["index.html", "capabilities.html", ...all.filter((page) => page === "hidden.html"), renderers[0], renderers.at(-1), evidence[0], evidence.at(-1)];
  for (const file of new Set(some)) {
    for (const width of [1440, 390]) await look(folder, file, { width, colorScheme: "light" });
    await look(folder, file, { width: 1440, colorScheme: "dark" });
  }
}
await browser.close();
for (const wrong of wrongs) console.error(wrong);
console.log(`${done} checks, ${wrongs.length} failed`);
process.exitCode = wrongs.length > 0 || done === 0 ? 1 : 0;
