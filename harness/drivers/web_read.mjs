// Lets a page in headless Chromium read the meters of job.json with a renderer of the web. Prints one JSON document.
// usage: node web_read.mjs job.json PACKAGES CHROMIUM, in the folder of the job
import fs from "node:fs";
import path from "node:path";
import { createRequire } from "node:module";

const [jobFile, packages, program] = process.argv.slice(2);
const job = JSON.parse(fs.readFileSync(jobFile, "utf8"));
const { chromium } = createRequire(path.join(path.resolve(packages), "package.json"))("playwright-core");
const root = path.resolve(packages, "node_modules", job.package);
// Software WebGL 2 (SwiftShader): the same on every machine. No network is there, nor needed.
const FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--disable-dev-shm-usage",
  "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-breakpad"];
const IMPORTS = { imports: { three: "/package/build/three.webgpu.js", "three/webgpu": "/package/build/three.webgpu.js" } };
const PAGE = `<!doctype html><script type="importmap">${JSON.stringify(IMPORTS)}</script><script type="module" src="/page.js"></script>`;

// A name that leads nowhere, on which every file is answered from here.
const HOST = "http://luxproof.invalid";

/** What the page asks for: itself, the renderer's modules, the photometric files. */
function file(name) {
  if (name === "/page.js") return [path.resolve(job.page), "text/javascript"];
  if (name.startsWith("/package/")) return [path.join(root, name.slice("/package/".length)), "text/javascript"];
  return [path.resolve(path.basename(name)), "application/octet-stream"];
}

/** Chromium now and then ends while it starts, before anything was asked of it. */
async function launched(triesLeft) {
  try {
    return await chromium.launch({ executablePath: program, args: FLAGS });
  } catch (error) {
    if (triesLeft === 0) throw error;
    console.error(`Chromium did not start, once more: ${error.message}`);
    return launched(triesLeft - 1);
  }
}

/** A report tells the first line of a failure: what is wrong, without the page's stack. */
function failed(error) {
  console.error(String(error?.message ?? error).split("\n")[0]);
  process.exitCode = 1;
}

const browser = await launched(2);
try {
  const page = await browser.newPage();
  const troubles = [];
  page.on("console", (message) => {
    console.error(`${message.type()}: ${message.text()}`);
    if (message.type() === "error") troubles.push(message.text());
  });
  page.on("pageerror", (error) => troubles.push(String(error)));
  await page.route("**/*", (route) => {
    const name = decodeURIComponent(new URL(route.request().url()).pathname);
    if (name === "/") return route.fulfill({ contentType: "text/html", body: PAGE });
    const [at, contentType] = file(name);
    return fs.existsSync(at) ? route.fulfill({ contentType, body: fs.readFileSync(at) }) : route.fulfill({ status: 404, body: "" });
  });
  await page.goto(HOST);
  await page.waitForFunction(() => window.illuminance, null, { timeout: 0 }).catch((error) => { throw troubles[0] ?? error; });
  const answer = await page.evaluate((job) => window.illuminance(job), job);
  process.stdout.write(JSON.stringify({ ...answer, troubles }));
} catch (error) {
  failed(error);
} finally {
  await browser.close();
}
