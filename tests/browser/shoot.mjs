// Pictures of a report: node shoot.mjs REPORT.html FOLDER; its first screens wide and narrow, light and dark, and its plots.
import path from "node:path";
import { start } from "./chromium.mjs";

const [file, folder] = process.argv.slice(2);
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
await browser.close();
