// Looks at HTML reports as a reader would: node check.mjs REPORT.html...; names what is wrong and fails.
import { createRequire } from "node:module";
import path from "node:path";
import { readFileSync } from "node:fs";
import { availableParallelism } from "node:os";
import { start } from "./chromium.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const wrongs = [];
let done = 0;
const check = (place, holds, says) => { done += 1; if (!holds) wrongs.push(`${place}: ${says}`); };

// As axe sees the page, or the part of it that the selector names. Rows that are not shown, which it judges nothing of, are out of its way.
async function accessible(page, place, part = "html") {
  await page.evaluate(axe);
  const { violations, passes } = await page.evaluate(async (part) => {
    const hidden = [...document.querySelectorAll("tr[hidden]")].map((row) => [row, document.createComment("")]);
    for (const [row, mark] of hidden) row.replaceWith(mark);
    const found = await globalThis.axe.run(part, { resultTypes: ["violations"] });
    for (const [row, mark] of hidden) mark.replaceWith(row);
    return found;
  }, part);
  for (const v of violations) wrongs.push(`${place}: ${v.id}, ${v.help}: ${v.nodes.slice(0, 3).map((n) => n.target.join(" ")).join("; ")}`);
  check(place, passes.length > 10, "axe found next to nothing to check");
}

// What of the page's text the screen cuts off; a closed part shows none.
async function cut(page, width, place) {
  const found = await page.evaluate((width) => {
    const says = [];
    for (const element of document.querySelectorAll("nav *, main *")) {
      const own = [...element.childNodes].some((n) => n.nodeType === Node.TEXT_NODE && n.textContent.trim());
      if (!own || element.closest(".unseen, script, dialog:not([open])") || !element.checkVisibility({ visibilityProperty: true })) continue;
      const box = element.getBoundingClientRect();
      if (box.width > 0 && (box.right > width + 1 || box.left < -1)) says.push(`${element.tagName} "${element.textContent.trim().slice(0, 40)}" to ${Math.round(box.right)}`);
    }
    return says;
  }, width);
  check(place, found.length === 0, `${found.length} texts are cut off: ${found.slice(0, 3).join("; ")}`);
}

async function filters(page, place) {
  const box = page.locator(".readings").first();
  const visible = () => box.locator("tbody tr:not([hidden])").count();
  const total = await box.locator("tbody tr").count();
  const first = await visible();
  check(place, first > 0 && first === Math.min(total, 12), `${first} of ${total} rows at first`);
  if (total > 12) {
    await box.locator(".all").click();
    check(place, (await visible()) === total, "`Show all` does not show all");
  }
  const engine = box.locator("[data-filter=engine]").first();
  const name = await engine.getAttribute("value");
  await engine.uncheck();
  const left = await box.locator("tbody tr:not([hidden]) td:first-child").allTextContents();
  check(place, left.length < total && !left.some((t) => t.trim() === name), `unchecking ${name} leaves its rows`);
  await box.locator(".reset").click();
  await page.waitForFunction((n) => document.querySelector(".readings").querySelectorAll("tbody tr:not([hidden])").length === n, total);
  await box.locator("[data-filter=meter]").fill("[0]");
  const meters = await box.locator("tbody tr:not([hidden]) td button.more").evaluateAll((all) => all.map((b) => b.getAttribute("aria-label")));
  check(place, meters.length > 0 && meters.every((m) => m.includes("[0]")), `searching [0] shows ${meters}`);
  await box.locator("[data-filter=meter]").fill("no such meter");
  check(place, (await visible()) === 0 && (await box.locator(".shown").textContent()).startsWith("0 of 0"), "a search for nothing finds something");
  await box.locator(".reset").click();
}

async function sorting(page, place) {
  const box = page.locator(".readings").first();
  const head = box.locator(".sort[data-key=d]");
  const worst = () => box.locator("tbody tr:not([hidden])").first().evaluate((tr) => JSON.parse(document.getElementById("data").textContent).rows[tr.dataset.row][6]);
  await head.click();
  const up = await worst();
  await head.click();
  const down = await worst();
  check(place, up <= down && (await head.locator("..").getAttribute("aria-sort")) === "descending", `sorted ${up} then ${down}`);
}

async function keyboard(page, place) {
  const more = page.locator("tbody tr:not([hidden]) .more").first();
  await more.focus();
  await page.keyboard.press("Enter");
  const dialog = page.locator("dialog[open]");
  check(place, (await dialog.count()) === 1, "Enter opens no budget");
  check(place, (await dialog.locator(".parts tbody tr").count()) >= 2, "the budget has no components");
  await accessible(page, `${place}, budget`, "dialog[open]");
  await page.keyboard.press("Escape");
  check(place, (await dialog.count()) === 0, "Escape does not close the budget");
  check(place, await more.evaluate((b) => b === document.activeElement), "the focus does not come back");
  await page.locator(".matrix .open").first().focus();
  await page.keyboard.press("Enter");
  await page.waitForTimeout(50);
  const cell = await page.locator(".matrix .open").first().evaluate((b) => ({ ...b.dataset }));
  const engines = await page.locator(`.readings[data-procedure=${cell.procedure}] tbody tr:not([hidden]) td:first-child`).allTextContents();
  check(place, engines.length > 0 && engines.every((e) => e.trim() === cell.engine), `a cell of ${cell.engine} shows ${engines}`);
}

async function theme(page, place) {
  const paper = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const before = await paper();
  await page.locator(".theme").click();
  const after = await paper();
  check(place, before !== after, "the button does not change the colours");
  await page.locator(".theme").click();
  check(place, (await paper()) === before, "the button does not change them back");
}

async function print(page, place) {
  await page.emulateMedia({ media: "print" });
  check(place, !(await page.locator("nav").isVisible()) && (await page.locator("main h1").isVisible()), "paper shows the navigation");
  check(place, (await page.pdf({ format: "A4" })).length > 20000, "the printed page is empty");
  await page.emulateMedia({ media: "screen" });
}

const browser = await start();

async function look({ file, width, colorScheme }) {
  const place = `${path.basename(path.dirname(path.resolve(file)))}/${path.basename(file)} ${width} ${colorScheme}`;
  const { page, troubles } = await browser.open(path.resolve(file), { width, colorScheme });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  check(place, wide <= width, `it is ${wide} wide`);
  check(place, (await page.locator("figure svg").count()) > 0, "no plot is drawn");
  await cut(page, width, place);
  await accessible(page, place);
  await theme(page, place);
  if (colorScheme === "light") {
    await filters(page, place);
    await sorting(page, place);
    await keyboard(page, place);
    if (width === 1280) await print(page, place);
  }
  check(place, troubles.length === 0, troubles.join("; "));
  await page.context().close();
}

const looks = process.argv.slice(2).flatMap((file) =>
  [1280, 390].flatMap((width) => ["light", "dark"].map((colorScheme) => ({ file, width, colorScheme }))));
const inTurn = async () => { for (let next; (next = looks.shift()); ) await look(next); };
// Each page has a process of its own.
await Promise.all(Array.from({ length: availableParallelism() }, inTurn));
await browser.close();
for (const wrong of wrongs) console.error(wrong);
console.log(`${done} checks, ${wrongs.length} failed`);
process.exitCode = wrongs.length > 0 || done === 0 ? 1 : 0;
