// Pictures of a report: node shoot.mjs REPORT.html FOLDER [NAME]; wide and narrow, the first screens and the whole page.
import path from "node:path";
import { start } from "./chromium.mjs";

const [file, folder, name = "report"] = process.argv.slice(2);
const browser = await start();
for (const [width, scale] of [[1280, 1], [390, 2]]) {
  for (const colorScheme of ["light", "dark"]) {
    const { page } = await browser.open(path.resolve(file), { width, scale, colorScheme });
    const target = path.join(folder, `${name}-${width}-${colorScheme}.png`);
    await page.screenshot({ path: target, fullPage: process.env.WHOLE === "1" });
    console.log(target);
  }
}
await browser.close();
