// Lets a page in headless Chromium read the meters of jobs with a renderer of the web.
// usage: node web_read.mjs job.json PACKAGES CHROMIUM, in the folder of the job: prints one JSON document
//        node web_read.mjs --serve PACKAGES CHROMIUM: answers each {"job": PATH} of its standard input by a line; the page stays open
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import readline from "node:readline";
import { createRequire } from "node:module";

const [asked, packages, program] = process.argv.slice(2);
const { chromium } = createRequire(path.join(path.resolve(packages), "package.json"))("playwright-core");
// Software WebGL 2 (SwiftShader): the same on every machine. No network is there, nor needed.
const FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--disable-dev-shm-usage",
  "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-breakpad"];
const IMPORTS = { imports: { three: "/package/build/three.webgpu.js", "three/webgpu": "/package/build/three.webgpu.js" } };
const PAGE = `<!doctype html><script type="importmap">${JSON.stringify(IMPORTS)}</script><script type="module" src="/page.js"></script>`;

// A name that leads nowhere, on which every file is answered from here.
const HOST = "http://luxproof.invalid";

/** Chromium now and then ends while it starts, before anything was asked of it. */
async function launched(env, triesLeft) {
  try {
    return await chromium.launch({ executablePath: program, args: FLAGS, env });
  } catch (error) {
    if (triesLeft === 0) throw error;
    console.error(`Chromium did not start, once more: ${error.message}`);
    return launched(env, triesLeft - 1);
  }
}

// Each job draws in a context of its own, of which Chromium keeps sixteen.
const JOBS_OF_A_PAGE = 8;

// A page that loads or answers for longer hangs: usual jobs take less than ten seconds.
const MAX_PAGE_MS = 120_000;

/** What a page answers, or an error where it does not answer in time. */
async function inTime(answer) {
  let timer;
  const late = new Promise((_, failed) => {
    timer = setTimeout(() => {
      isBroken = true;
      failed(new Error(`the page gave no answer within ${MAX_PAGE_MS / 1000} s`));
    }, MAX_PAGE_MS);
  });
  return Promise.race([answer, late]).finally(() => clearTimeout(timer));
}

/** A renderer in its page: what it logs, and the folders of the jobs that it was asked. */
class Renderer {
  constructor(source, root) {
    Object.assign(this, { source, root, jobs: [], troubles: [] });
  }

  /** What the page asks for: itself, the renderer's modules, the photometric files below the numbers of their jobs. */
  file(name) {
    if (name === "/page.js") return [this.source, "text/javascript"];
    if (name.startsWith("/package/")) return [path.join(this.root, name.slice("/package/".length)), "text/javascript"];
    const [number, own] = name.split("/").slice(1);
    return [path.join(this.jobs[number] ?? "", path.basename(own ?? "")), "application/octet-stream"];
  }

  async open(browser) {
    this.page = await browser.newPage();
    this.page.on("console", (message) => {
      console.error(`${message.type()}: ${message.text()}`);
      if (message.type() === "error") this.troubles.push(message.text());
    });
    this.page.on("crash", () => { isBroken = true; });
    this.page.on("pageerror", (error) => this.troubles.push(String(error)));
    await this.page.route("**/*", (route) => {
      const name = decodeURIComponent(new URL(route.request().url()).pathname);
      if (name === "/") return route.fulfill({ contentType: "text/html", body: PAGE });
      const [at, contentType] = this.file(name);
      return fs.existsSync(at) ? route.fulfill({ contentType, body: fs.readFileSync(at) }) : route.fulfill({ status: 404, body: "" });
    });
    await this.page.goto(HOST);
    await this.page.waitForFunction(() => window.illuminance, null, { timeout: MAX_PAGE_MS }).catch((error) => { throw this.troubles[0] ?? error; });
  }

  async answer(job, folder) {
    const number = this.jobs.push(folder) - 1;
    // What a job that was answered complained of afterwards is in its log.
    if (number > 0) this.troubles.length = 0;
    const lamps = job.lamps.map((lamp) => ({ ...lamp, file: `${number}/${lamp.file}` }));
    const answer = await inTime(this.page.evaluate((job) => window.illuminance(job), { ...job, lamps }));
    return { ...answer, troubles: this.troubles };
  }
}

/** The files of the jobs that are asked for. */
async function* jobFiles() {
  if (asked !== "--serve") return yield asked;
  for await (const line of readline.createInterface({ input: process.stdin })) yield JSON.parse(line).job;
}

// Where the browser keeps profiles, caches and locks.
const home = fs.mkdtempSync(path.join(os.tmpdir(), "browser-"));
process.env.TMPDIR = home;
const browser = await launched({ ...process.env, HOME: home, XDG_CONFIG_HOME: home, XDG_CACHE_HOME: home }, 2);
const renderers = new Map();
let isBroken = false;
browser.on("disconnected", () => { isBroken = true; });
try {
  for await (const jobFile of jobFiles()) {
    const job = JSON.parse(fs.readFileSync(jobFile, "utf8")), folder = path.dirname(path.resolve(jobFile));
    let renderer = renderers.get(job.package);
    if (!renderer || renderer.jobs.length === JOBS_OF_A_PAGE) {
      await renderer?.page.close();
      renderer = new Renderer(path.join(folder, job.page), path.resolve(packages, "node_modules", job.package));
      await renderer.open(browser);
      renderers.set(job.package, renderer);
    }
    const answer = await renderer.answer(job, folder);
    process.stdout.write(`${JSON.stringify(answer)}\n`);
  }
} catch (error) {
  // A report tells the first line of a failure: what is wrong, without the page's stack.
  console.error(String(error?.message ?? error).split("\n")[0]);
  // A page that crashes or hangs refuses nothing: 134 is what a shell reports of a program that aborts.
  process.exitCode = isBroken ? 134 : 1;
} finally {
  await browser.close();
  fs.rmSync(home, { recursive: true, force: true });
}
// Standard input may stay open, and would keep this program alive without an answer.
process.exit();
