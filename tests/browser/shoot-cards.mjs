// A picture of the first screen of a site of score cards: node shoot-cards.mjs SITE FOLDER.
import path from "node:path";
import { start } from "./chromium.mjs";

const [site, folder] = process.argv.slice(2);
const browser = await start();
const { page } = await browser.open(path.resolve(site, "index.html"), { width: 1280, height: 1000 });
const target = path.join(folder, "score-cards.png");
await page.screenshot({ path: target });
console.log(target);
await browser.close();
