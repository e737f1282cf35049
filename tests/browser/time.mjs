// Prints how many seconds a page takes in a browser that is there already, from its address to its first frame: node time.mjs PAGE; the median of five.
import path from "node:path";
import { start } from "./chromium.mjs";

const seconds = [];
for (let k = 0; k < 5; k += 1) {
  const browser = await start();
  const clock = performance.now();
  const { page, troubles } = await browser.open(path.resolve(process.argv[2]), { width: 1280 });
  await page.evaluate(() => new Promise((done) => { requestAnimationFrame(() => setTimeout(done)); }));
  seconds.push((performance.now() - clock) / 1000);
  if (troubles.length > 0) throw new Error(troubles.join("; "));
  await browser.close();
}
console.log(seconds.sort((a, b) => a - b)[2].toFixed(1));
