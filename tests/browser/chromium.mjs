// Starts Debian's Chromium (or what CHROMIUM names) without any network, and opens a report in it.
import { execFileSync } from "node:child_process";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--font-render-hinting=none"];

function program() {
  if (process.env.CHROMIUM) return process.env.CHROMIUM;
  for (const name of ["chromium", "chromium-browser", "google-chrome"]) {
    try {
      return execFileSync("sh", ["-c", `command -v ${name}`], { encoding: "utf8" }).trim();
    } catch {
      // The next one, then.
    }
  }
  throw new Error("no Chromium: install Debian's package `chromium`, or name the program in CHROMIUM");
}

/** A browser; `open` gives a page of a report and what went wrong in it, `blank` an empty page. */
export async function start() {
  const browser = await chromium.launch({ executablePath: program(), args: FLAGS });
  const open = async (file, { width, colorScheme = "light", scale = 1, height = 900 }) => {
    const context = await browser.newContext({ viewport: { width, height }, colorScheme, deviceScaleFactor: scale });
    const page = await context.newPage();
    const troubles = [];
    page.on("console", (message) => { if (["error", "warning"].includes(message.type())) troubles.push(message.text()); });
    page.on("pageerror", (error) => troubles.push(String(error)));
    page.on("request", (request) => { if (!request.url().startsWith("file:")) troubles.push(`it asks for ${request.url()}`); });
    await page.goto(pathToFileURL(file).href);
    return { page, troubles };
  };
  const blank = async (viewport) => ({ page: await (await browser.newContext({ viewport })).newPage() });
  return { open, blank, close: () => browser.close() };
}
