// Takes a picture of the 3-D view of a report page in headless Chromium.
//
//   node picture.mjs [--mode NAME] [--view NAME] [--chromium PATH] REPORT.html PICTURE.png

import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { parseArgs } from "node:util";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";
import { FLAGS } from "./browser.mjs";

const { values: options, positionals: [report, picture] } = parseArgs({
  allowPositionals: true,
  options: { mode: { type: "string" }, view: { type: "string" }, chromium: { type: "string", default: "/usr/bin/chromium" } },
});
const profile = mkdtempSync(join(tmpdir(), "nurbskin-picture-"));
const browser = await chromium.launchPersistentContext(profile, {
  executablePath: options.chromium, headless: true, chromiumSandbox: false, args: FLAGS, viewport: { width: 1100, height: 800 },
  reducedMotion: "reduce",
});
const page = await browser.newPage();
await page.goto(pathToFileURL(resolve(report)).href);
await page.evaluate(() => window.nurbskin.ready);
if (await page.locator("[data-layer=worst]").count()) await page.click("[data-layer=worst]");
if (options.mode) await page.selectOption("#mode", options.mode);
if (options.view) await page.click(`[data-view=${options.view}]`);
await page.waitForTimeout(300);
await page.locator("#canvas").screenshot({ path: picture });
await browser.close();
rmSync(profile, { recursive: true, force: true });
