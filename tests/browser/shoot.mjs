// Pictures of a report: node shoot.mjs REPORT.html FOLDER [TERMINAL.txt...]; its first screens wide and narrow, light and dark, its plots,
// and what terminals print of it, each in a picture of the file's name.
import { readFileSync } from "node:fs";
import path from "node:path";
import { start } from "./chromium.mjs";

const [file, folder, ...terminals] = process.argv.slice(2);
const browser = await start();
const open = (size, colorScheme) => browser.open(path.resolve(file), { ...size, colorScheme });
for (const [size, schemes] of [[{ width: 1280, height: 1560, scale: 1 }, ["light", "dark"]], [{ width: 390, height: 1500, scale: 2 }, ["light"]]]) {
  for (const scheme of schemes) {
    const { page } = await open(size, scheme);
    const target = path.join(folder, `report-${size.width}${scheme === "dark" ? "-dark" : ""}.png`);
    await page.screenshot({ path: target });
    console.log(target);
  }
}
for (const width of [1280, 390]) {
  const { page } = await open({ width, height: 1500, scale: width === 390 ? 2 : 1 }, "light");
  await page.evaluate(() => { document.documentElement.style.scrollBehavior = "auto"; document.querySelector("section:nth-of-type(2)").scrollIntoView(); });
  const target = path.join(folder, `report-${width}-plots.png`);
  await page.screenshot({ path: target });
  console.log(target);
}

const COLOURS = { 9: "#c0392b", 10: "#0a7a5c", 11: "#8a6100", 14: "#1f6f8b" };
// HTML of what a terminal shows: bold, and the colours of verdicts.
function shown(text) {
  let open = 0;
  const close = () => "</span>".repeat(open);
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll("\r", "").replace(/\x1b\[([\d;]*)m/g, (_, code) => {
    const colour = COLOURS[code.match(/38;5;(\d+)/)?.[1]];
    if (colour || code === "1") { open += 1; return `<span style="${colour ? `color:${colour}` : "font-weight:700"}">`; }
    const ends = close();
    open = 0;
    return ends;
  }) + close();
}
for (const terminal of terminals) {
  const text = readFileSync(terminal, "utf8").trim();
  const lines = text.replace(/\x1b\[[\d;]*m/g, "").split("\n");
  const columns = Number(path.basename(terminal, ".txt").match(/\d+$/)?.[0]) || Math.max(...lines.map((line) => line.length));
  const { page } = await browser.blank({ width: Math.ceil(8 * columns) + 32, height: 18 * Math.min(lines.length, 60) + 24 });
  await page.setContent(`<pre style="margin:12px 16px;font:13.3px/18px 'DejaVu Sans Mono',monospace;color:#17191d">${shown(text)}</pre>`);
  const target = path.join(folder, `${path.basename(terminal, ".txt")}.png`);
  await page.screenshot({ path: target });
  console.log(target);
}
await browser.close();
