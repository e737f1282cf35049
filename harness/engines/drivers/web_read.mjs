// Lets a page in headless Chromium read the meters of jobs with a renderer of the web.
// usage: node web_read.mjs job.json PACKAGES CHROMIUM, in the folder of the job: prints one JSON document
//        node web_read.mjs --serve PACKAGES CHROMIUM: answers each line of its standard input by a line; the page stays open
//
// {"job": PATH} is answered by all readings. A page that samples answers by what there is to read, and each request for blocks,
// {"part": ..., "side": m, "seeds": [...]}, by their readings, as blocks.py does. {"warm": PATH} only compiles what the job needs.
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

/** The page, with the modules that its scripts name. */
function html(imports) {
  return `<!doctype html><script type="importmap">${JSON.stringify({ imports })}</script><script type="module" src="/page.js"></script>`;
}

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
// One that samples compiles its shader for a minute on an idle core, and traces paths for as long as its job says.
const MAX_SAMPLER_MS = 1_800_000;

/** What a page answers, or an error where it does not answer in time. */
async function inTime(answer, limit_ms = MAX_PAGE_MS) {
  let timer;
  const late = new Promise((_, failed) => {
    timer = setTimeout(() => {
      isBroken = true;
      failed(new Error(`the page gave no answer within ${limit_ms / 1000} s`));
    }, limit_ms);
  });
  return Promise.race([answer, late]).finally(() => clearTimeout(timer));
}

/** A renderer in its page: what it logs, and the folders of the jobs that it was asked. */
class Renderer {
  constructor(source, name, imports) {
    const modules = path.resolve(packages, "node_modules"), root = path.join(modules, name);
    const { version } = JSON.parse(fs.readFileSync(path.join(root, "package.json"), "utf8"));
    Object.assign(this, { source, modules, root, name, version, imports, jobs: [], troubles: [] });
  }

  /** What the page asks for: itself, modules of the renderer and of others, the photometric files below the numbers of their jobs. */
  file(name) {
    if (name === "/page.js") return [this.source, "text/javascript"];
    if (name.startsWith("/package/")) return [path.join(this.root, name.slice("/package/".length)), "text/javascript"];
    if (name.startsWith("/modules/")) return [path.join(this.modules, name.slice("/modules/".length)), "text/javascript"];
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
      if (name === "/") return route.fulfill({ contentType: "text/html", body: html(this.imports) });
      const [at, contentType] = this.file(name);
      return fs.existsSync(at) ? route.fulfill({ contentType, body: fs.readFileSync(at) }) : route.fulfill({ status: 404, body: "" });
    });
    await this.page.goto(HOST);
    await this.page.waitForFunction(() => window.illuminance ?? window.sampler, null, { timeout: MAX_PAGE_MS }).catch((error) => { throw this.troubles[0] ?? error; });
    this.samples = await inTime(this.page.evaluate(() => Boolean(window.sampler)));
  }

  async answer(job, folder) {
    const number = this.jobs.push(folder) - 1;
    // What a job that was answered complained of afterwards is in its log.
    if (number > 0) this.troubles.length = 0;
    const lamps = job.lamps.map((lamp) => ({ ...lamp, file: `${number}/${lamp.file}` }));
    if (this.samples) return this.ask("begin", { ...job, lamps, version: this.version });
    const answer = await inTime(this.page.evaluate((job) => window.illuminance(job), { ...job, lamps }));
    return { ...answer, troubles: this.troubles };
  }

  /** What a page that samples answers; an error that it logs is its answer. */
  async ask(what, about) {
    const answer = await inTime(this.page.evaluate(([what, about]) => window.sampler[what](about), [what, about]), MAX_SAMPLER_MS);
    if (this.troubles.length) throw new Error(`its page says: ${this.troubles[0]}`);
    return answer;
  }

  /** All readings of a job that samples, by as many blocks as it says. */
  async readings(job, { parts, sensors, versions, variant }) {
    const value = sensors.map(() => 0), variance = sensors.map(() => 0);
    for (const [k, { name, sampled }] of parts.entries()) {
      const seeds = sampled ? Array.from({ length: job.blocks }, (_, block) => [job.seed, k, block]) : [null];
      const blocks = await this.ask("blocks", { part: name, side: sampled ? job.side : 1, seeds });
      for (const m of sensors.keys()) {
        const mean = blocks.reduce((sum, block) => sum + block[m], 0) / blocks.length;
        value[m] += mean;
        if (sampled) variance[m] += blocks.reduce((sum, block) => sum + (block[m] - mean) ** 2, 0) / (blocks.length - 1) / blocks.length;
      }
    }
    return { versions, variant, readings: sensors.map((id, m) => ({ id, value: value[m], std_error: Math.sqrt(variance[m]) })) };
  }
}

const renderers = new Map();

/** The renderer of a job, in a page that stays open where it draws all jobs in one context. */
async function rendererOf(job, folder) {
  let renderer = renderers.get(job.package);
  if (!renderer || (!renderer.samples && renderer.jobs.length === JOBS_OF_A_PAGE)) {
    await renderer?.page.close();
    renderer = new Renderer(path.join(folder, job.page), job.package, job.imports);
    await renderer.open(browser);
    renderers.set(job.package, renderer);
  }
  return renderer;
}

/** The answers to what is asked for, in its order. */
async function* answers() {
  let renderer;
  for await (const request of requests()) {
    if (request.part) {
      yield await renderer.ask("blocks", request);
      continue;
    }
    const jobFile = request.job ?? request.warm, folder = path.dirname(path.resolve(jobFile));
    const job = JSON.parse(fs.readFileSync(jobFile, "utf8"));
    renderer = await rendererOf(job, folder);
    if (request.warm) {
      yield await renderer.ask("warm", job);
      continue;
    }
    const answer = await renderer.answer(job, folder);
    yield renderer.samples && asked !== "--serve" ? await renderer.readings(job, answer) : answer;
  }
}

/** What is asked for. */
async function* requests() {
  if (asked !== "--serve") return yield { job: asked };
  for await (const line of readline.createInterface({ input: process.stdin })) yield JSON.parse(line);
}

// Where the browser keeps profiles, caches and locks.
const home = fs.mkdtempSync(path.join(os.tmpdir(), "browser-"));
process.env.TMPDIR = home;
const browser = await launched({ ...process.env, HOME: home, XDG_CONFIG_HOME: home, XDG_CACHE_HOME: home }, 2);
let isBroken = false;
browser.on("disconnected", () => { isBroken = true; });
try {
  for await (const answer of answers()) process.stdout.write(`${JSON.stringify(answer)}\n`);
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
