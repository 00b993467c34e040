// Drives the built page in headless Chromium, as a user does.
//
//   node e2e/run.mjs [--short] [--scans FOLDER] [--tool nurbskin] [--shots FOLDER] [--chromium PATH] [TEST...]
//
// `--short` leaves out what takes longer than a few seconds. `--scans` is the folder of real scans, `--tool` the command that
// the files are compared with; what needs one that is not there is skipped, with the reason. Prints a line per test; the exit
// status is 1 if any fails. WebGL is drawn in software.

import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { createRequire } from "node:module";
import { parseArgs } from "node:util";
import { gzipSync } from "node:zlib";
import { chromium } from "playwright-core";
import { FLAGS } from "../../tests/pages/browser.mjs";
import { serve } from "./server.mjs";

const here = dirname(fileURLToPath(import.meta.url)), dist = join(here, "../dist");
/** The date in the headers of files, in the page and in the command. */
const DATE = "1700000000";
/** Bytes of memory that 1 M points do not fit into. */
const FEW_BYTES = 64e6;
/** Bytes of page and module, compressed. */
const MOST_BYTES = 4e6;

const { values: options, positionals: wanted } = parseArgs({
  allowPositionals: true,
  options: {
    short: { type: "boolean", default: false }, scans: { type: "string", default: process.env.NURBSKIN_DATA ?? "" },
    tool: { type: "string", default: "" }, shots: { type: "string" }, chromium: { type: "string", default: "/usr/bin/chromium" },
  },
});
const built = readdirSync(dist, { recursive: true }).map((name) => join(dist, name)).filter((path) => statSync(path).isFile());
/** Whether the module of the page can have threads: it then takes its memory from the page. */
const threaded = built.filter((path) => path.endsWith(".wasm")).some((path) => WebAssembly.Module.imports(new WebAssembly.Module(readFileSync(path))).some(({ kind }) => kind === "memory"));
const needsThreads = () => { if (!threaded) throw new Skipped("the module is built for one thread"); };
const work = mkdtempSync(join(tmpdir(), "nurbskin-web-"));
if (options.shots) mkdirSync(options.shots, { recursive: true });
const browser = await chromium.launch({ executablePath: options.chromium, headless: true, chromiumSandbox: false, args: FLAGS });
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

class Skipped extends Error {}
const expect = (good, what) => { if (!good) throw new Error(what); };
const scanOf = (name) => {
  const path = join(options.scans, name);
  if (!options.scans || !existsSync(path)) throw new Skipped(`there is no ${name}: set NURBSKIN_DATA`);
  return path;
};

/** Opens the page; `faults` are its errors, and requests to anywhere else. */
async function open(server, { viewport = { width: 1280, height: 800 }, dark = false, query = `?date=${DATE}`, context } = {}) {
  const own = context ?? await browser.newContext({ viewport, colorScheme: dark ? "dark" : "light", reducedMotion: "reduce", acceptDownloads: true });
  const page = await own.newPage();
  const faults = [];
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => { if (message.type() === "error") faults.push(message.text()); });
  page.on("request", (request) => { if (!/^(blob|data):/.test(request.url()) && !request.url().startsWith(new URL(server.url).origin)) faults.push(`request to ${request.url()}`); });
  await page.goto(server.url + query);
  return { page, faults, done: async () => { expect(faults.length === 0, faults.join("; ")); await own.close(); } };
}

const drop = (page, ...files) => page.setInputFiles("#picker", files);
const idle = (page, timeout = 240_000) => page.waitForFunction(() => document.querySelector("#working").hidden, null, { timeout });

async function chosenUnit(page, unit) {
  if (!await page.locator(`#unit-choices input[value=${unit}]`).isChecked()) await page.locator(`#unit-choices input[value=${unit}]`).check();
}

async function fit(page, timeout = 240_000) {
  await page.click("#make");
  await page.waitForFunction(() => !document.querySelector("#working").hidden || !document.querySelector("#failure").hidden, null, { timeout });
  await idle(page, timeout);
  expect(await page.locator("#result").isVisible(), `no result: ${await page.locator("#failure").textContent()}`);
}

async function saved(page, format) {
  const waiting = page.waitForEvent("download");
  await page.click(`[data-save=${format}]`);
  const download = await waiting;
  const path = join(work, `page-${download.suggestedFilename()}`);
  await download.saveAs(path);
  await idle(page);
  return path;
}

/** A figure of the result, by its name. */
const figure = async (page, name) => (await page.locator(`#figures dt:text-is("${name}") + dd`).textContent()) ?? "";

/** A cloud of so many points as a PLY file: a sheet of 200 mm by 150 mm with waves of 8 mm, and noise of 0.05 mm at most. */
function cloud(points) {
  const path = join(work, `cloud-${points}.ply`);
  const head = `ply\nformat binary_little_endian 1.0\ncomment unit mm\nelement vertex ${points}\nproperty float x\nproperty float y\nproperty float z\nend_header\n`;
  // A generator of 32 bits with the constants of Numerical Recipes (2nd edition, 7.1), so that the file is always the same.
  let state = 1;
  const random = () => { state = (Math.imul(state, 1664525) + 1013904223) >>> 0; return state / 2 ** 32; };
  const content = Buffer.alloc(12 * points);
  for (let k = 0; k < points; k++) {
    const x = 200 * random(), y = 150 * random(), z = 8 * Math.sin(x / 30) * Math.cos(y / 25) + 0.1 * (random() - 0.5);
    [x, y, z].forEach((value, axis) => content.writeFloatLE(value, 12 * k + 4 * axis));
  }
  writeFileSync(path, Buffer.concat([Buffer.from(head), content]));
  return path;
}

const shot = async (page, name, fullPage = false) => {
  if (options.shots) await page.screenshot({ path: join(options.shots, `${name}.png`), fullPage });
};

/** The STEP file of the command, on one thread, and its seconds. */
function ofCommand(scan, unit) {
  if (!options.tool || !existsSync(options.tool)) throw new Skipped("no command to compare with: name it with --tool");
  const to = join(work, basename(scan).replace(/\.[^.]*$/, ".step"));
  const begun = performance.now();
  const done = spawnSync(options.tool, ["fit", scan, "--threads", "1", "--unit", unit, "--quiet", "-o", to], { env: { ...process.env, SOURCE_DATE_EPOCH: DATE }, encoding: "utf8", maxBuffer: 1 << 28 });
  expect(done.status === 0 || done.status === 3, `the command: ${done.stderr}`);
  return { to, seconds: (performance.now() - begun) / 1000 };
}

const violations = async (page) => {
  await page.evaluate(axe);
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  return found.violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`);
};

/** Pixels of the view unlike its first one, as a share. */
const covered = (page) => page.evaluate(() => {
  const canvas = document.querySelector("#view canvas");
  const copy = document.createElement("canvas");
  [copy.width, copy.height] = [canvas.width, canvas.height];
  const context = copy.getContext("2d");
  context.drawImage(canvas, 0, 0);
  const { data } = context.getImageData(0, 0, copy.width, copy.height);
  let other = 0;
  for (let k = 0; k < data.length; k += 4) if (Math.abs(data[k] - data[0]) + Math.abs(data[k + 1] - data[1]) + Math.abs(data[k + 2] - data[2]) > 24) other++;
  return other / (data.length / 4);
});

/** Waits until more than the share `least` of the pixels of the view are covered: a view is drawn frames after its data has come. */
async function drawn(page, least, what) {
  const end = performance.now() + 10_000;
  let share = await covered(page);
  while (share <= least && performance.now() < end) {
    await page.waitForTimeout(50);
    share = await covered(page);
  }
  expect(share > least, `${what}: ${(100 * share).toFixed(1)} % of the pixels are covered, after 10 s`);
}

const tests = {
  async "page and module are small"() {
    const bytes = built.reduce((sum, path) => sum + gzipSync(readFileSync(path), { level: 9 }).length, 0);
    expect(bytes < MOST_BYTES, `${(bytes / 1e6).toFixed(2)} MB compressed`);
    return `${(bytes / 1e6).toFixed(2)} MB compressed`;
  },

  async "an example becomes a STEP file, by keyboard"(server) {
    const { page, done } = await open(server);
    await shot(page, "welcome");
    await page.locator("[data-example=saddle]").focus();
    await page.keyboard.press("Enter");
    await page.waitForSelector("#files li");
    await idle(page);
    await drawn(page, 0.01, "the points are not drawn");
    await page.locator("#make").focus();
    await page.keyboard.press("Enter");
    await page.waitForSelector("#result:not([hidden])", { timeout: 120_000 });
    expect(await page.evaluate(() => document.activeElement.id) === "verdict", "the result is not announced by the focus");
    await drawn(page, 0.05, "the surface is not drawn");
    await page.locator("#view canvas").focus();
    for (const key of ["ArrowLeft", "ArrowUp", "+", "-", "f"]) await page.keyboard.press(key);
    const step = readFileSync(await saved(page, "step"), "latin1");
    expect(step.startsWith("ISO-10303-21;") && step.includes("FILE_NAME('panel.step','2023-11-14T22:13:20'"), step.slice(0, 200));
    for (const [format, begin] of [["igs", "nurbs surface by nurbskin"], ["stl", ""], ["glb", "glTF"], ["html", "<!doctype html>"], ["json", "{"], ["csv", "index,x,y,z"]]) {
      const text = readFileSync(await saved(page, format), "latin1");
      expect(text.length > 500 && text.toLowerCase().startsWith(begin.toLowerCase()), `${format}: ${text.slice(0, 60)}`);
    }
    for (const mode of ["zebra", "mean_curvature", "gaussian_curvature", "plain", "deviation"]) {
      await page.selectOption("#mode", mode);
      await page.waitForTimeout(100);
      await drawn(page, 0.05, `nothing is drawn with the colours ${mode}`);
    }
    for (const layer of ["net", "iso", "points"]) await page.check(`[data-layer=${layer}]`);
    await page.locator("#worst button").first().click();
    // Drawn with the next picture.
    await page.waitForSelector("#overlay .chosen", { timeout: 5000 });
    await page.waitForTimeout(300);
    await page.locator("#overlay .pin[role=button]").nth(1).focus();
    await page.keyboard.press("Enter");
    await page.waitForFunction(() => /^2:/.test(document.querySelector("#overlay .chosen text")?.textContent ?? ""), null, { timeout: 5000 });
    await shot(page, "result");
    await done();
  },

  async "no rule of accessibility is broken, wide or narrow, light or dark"(server) {
    const said = [];
    for (const [name, viewport, dark] of [["wide", { width: 1280, height: 800 }, false], ["phone", { width: 360, height: 740 }, true]]) {
      const { page, done } = await open(server, { viewport, dark });
      said.push(...await violations(page));
      await shot(page, `${name}-welcome`, true);
      await page.click("[data-example=pot]");
      await page.waitForSelector("#files li");
      await idle(page);
      await fit(page);
      await page.evaluate(() => { for (const details of document.querySelectorAll("details")) details.open = true; });
      said.push(...await violations(page));
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
      expect(wide <= 0, `${name}: ${wide} pixels stick out`);
      await shot(page, `${name}-result`, true);
      await done();
    }
    expect(said.length === 0, said.join("\n"));
  },

  async "the unit is asked for where the file does not say it"(server) {
    const { page, done } = await open(server);
    const path = join(work, "sheet.xyz");
    const rows = [];
    for (let i = 0; i < 30; i++) for (let j = 0; j < 30; j++) rows.push(`${i} ${j} ${0.02 * i * j}`);
    writeFileSync(path, rows.join("\n"));
    await drop(page, path);
    await page.waitForSelector("#files li");
    await idle(page);
    expect(await page.locator("#make").isDisabled(), "the surface can be made without a unit");
    expect((await page.locator("#unit-choices").textContent()).includes("29 mm"), "the size is not pictured");
    await shot(page, "unit");
    await chosenUnit(page, "in");
    await page.fill("#tolerance", "-1");
    await page.click("#make");
    expect((await page.locator("#failure").textContent()).includes("above zero"), "a wrong tolerance is taken");
    await page.fill("#tolerance", "0.01");
    await page.selectOption("#tolerance-unit", "in");
    await fit(page);
    expect((await page.locator("#verdict").textContent()) === "Passed", await page.locator("#reason").textContent());
    const figures = JSON.parse(readFileSync(await saved(page, "json"), "utf8"));
    expect(figures.input.unit === "in" && figures.tolerance === 0.01 && figures.verdict === "pass", JSON.stringify(figures.input));
    // The project gives the same result again.
    const first = readFileSync(await saved(page, "step"));
    const project = await saved(page, "project");
    await page.reload();
    await drop(page, project.replace(/page-/, "page-"));
    await drop(page, path);
    await page.waitForSelector("#files li");
    await idle(page);
    expect(await page.inputValue("#tolerance") === "0.01", "the project has not set the tolerance");
    await fit(page);
    expect(first.equals(readFileSync(await saved(page, "step"))), "the project gives another file");
    await done();
  },

  async "a file that is no scan is refused in words, and the page goes on"(server) {
    const { page, done } = await open(server);
    const bad = { "a.ply": "ply\nformat ascii 1.0\nelement vertex 999999999\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n", "b.stl": "", "c.xyz": "hello\n", "d.step": "ISO-10303-21;\nHEADER;" };
    for (const [name, text] of Object.entries(bad)) {
      const path = join(work, name);
      writeFileSync(path, text);
      await drop(page, path);
      await page.waitForSelector("#failure:not([hidden])");
      await idle(page);
      const said = await page.locator("#failure").textContent();
      expect(said.includes(name) && !/went wrong inside|memory/.test(said), `${name}: ${said}`);
    }
    expect(await page.locator("#welcome").isVisible(), "a refused file is in the list");
    await page.click("[data-example=torus]");
    await page.waitForSelector("#files li");
    await done();
  },

  async "a scan is compared with a CAD file"(server) {
    const { page, done } = await open(server);
    await page.click("[data-example=saddle]");
    await page.waitForSelector("#files li");
    await idle(page);
    await fit(page);
    const step = await saved(page, "step");
    await drop(page, step);
    await page.waitForSelector("#compare:not([hidden])");
    await idle(page);
    await page.fill("#tolerance", "0.5");
    await page.click("#compare");
    await page.waitForFunction(() => document.querySelector("#verdict").textContent.length > 0 && document.querySelector("#result").hidden === false && document.querySelector("#save-section [data-save=step]") === null, null, { timeout: 120_000 });
    await idle(page);
    expect((await page.locator("#verdict").textContent()) === "Passed", await page.locator("#reason").textContent());
    expect(await page.locator("#saves button").count() === 4, "a comparison has three reports and the project");
    const csv = readFileSync(await saved(page, "csv"), "utf8");
    expect(csv.split("\n").length > 7000, "points are missing from the CSV");
    await shot(page, "compared");
    await done();
  },

  async "a fit is cancelled at once, and can be made again"() {
    for (const isolated of [false, true]) {
      const own = await serve(dist, { isolated });
      const { page, done } = await open(own);
      await page.click("[data-example=face]");
      await page.waitForSelector("#files li");
      await idle(page);
      // Below the noise, so that it takes long.
      await page.fill("#tolerance", "0.05");
      await page.click("#make");
      await page.waitForSelector("#working:not([hidden])");
      await page.waitForTimeout(300);
      expect(await page.locator("#make").isDisabled(), "a second fit can be started");
      expect(await page.evaluate(() => window.crossOriginIsolated) === isolated, "isolation");
      const begun = Date.now();
      await page.click("#cancel");
      await idle(page, 10_000);
      expect(Date.now() - begun < 3000, `cancelling took ${Date.now() - begun} ms`);
      expect(await page.locator("#result").isHidden(), "there is a result after all");
      await page.fill("#tolerance", "");
      if (isolated) await fit(page);
      await done();
      await own.close();
    }
  },

  async "the STEP file is the same on one thread and on several, isolated or not"() {
    needsThreads();
    let first = null;
    const said = [];
    for (const [isolated, threads, others] of [[false, 3, 0], [true, 1, 0], [true, 3, 2]]) {
      const own = await serve(dist, { isolated });
      const { page, done } = await open(own, { query: `?date=${DATE}&threads=${threads}` });
      await page.click("[data-example=face]");
      await page.waitForSelector("#files li");
      await idle(page);
      await fit(page);
      expect(page.workers().length === 1 + others, `${page.workers().length} workers, isolated: ${isolated}`);
      const time = await figure(page, "Time");
      expect(time.endsWith(others ? `on ${threads} threads` : " s"), time);
      said.push(time);
      const step = readFileSync(await saved(page, "step"));
      first ??= step;
      expect(step.equals(first), `another file, isolated: ${isolated}, threads: ${threads}`);
      await done();
      await own.close();
    }
    return said.join(", ");
  },

  async "the page says that the memory is full, and goes on"() {
    needsThreads();
    for (const isolated of [false, true]) {
      const own = await serve(dist, { isolated });
      // The points and what cleaning them needs are more than this, and the example is less.
      const { page, done } = await open(own, { query: `?memory=${FEW_BYTES}&threads=2` });
      await drop(page, cloud(1e6));
      await page.waitForSelector("#failure:not([hidden])", { timeout: 60_000 });
      await idle(page);
      const said = await page.locator("#failure").textContent();
      expect(said.includes("memory that a web page may use is full"), said);
      const end = performance.now() + 10_000;
      while (page.workers().length > 0 && performance.now() < end) await page.waitForTimeout(50);
      expect(page.workers().length === 0, `${page.workers().length} workers have not ended, isolated: ${isolated}`);
      await page.click("[data-example=saddle]");
      await page.waitForSelector("#files li");
      await idle(page);
      await fit(page);
      await done();
      await own.close();
    }
  },

  async "the page works without a network after the first visit"() {
    const own = await serve(dist);
    const context = await browser.newContext();
    const { page } = await open(own, { context, query: "" });
    await page.evaluate(() => window.navigator.serviceWorker.ready);
    await page.waitForFunction(async () => (await caches.keys()).length === 1);
    await own.close();
    await page.reload();
    await page.click("[data-example=torus]");
    await page.waitForSelector("#files li");
    await idle(page);
    await drawn(page, 0.01, "nothing is drawn");
    await context.close();
  },

  async "`nurbskin app` serves the page"() {
    if (!options.tool || !existsSync(options.tool)) throw new Skipped("no command: name it with --tool");
    const child = spawn(options.tool, ["app", "--no-open", "--folder", dist], { stdio: ["ignore", "pipe", "inherit"] });
    try {
      const url = (await new Promise((done) => child.stdout.once("data", (text) => done(String(text))))).trim();
      const { page, done } = await open({ url });
      await page.click("[data-example=torus]");
      await page.waitForSelector("#files li");
      expect(await page.evaluate(() => window.crossOriginIsolated), "the page is not isolated");
      await done();
    } finally {
      child.kill();
    }
  },
};

/** Real scans, with the unit that is chosen; the first is a mesh of 36,000 points. */
const SCANS = [
  ["classics/stanford_bun_zipper.ply", "m"], ["tubes/ycb_mustard_body_crop.ply", "m"], ["faces/fran_cut.ply", "m"],
  ["classics/cgal_kitten_normals.xyz", "mm"], ["tubes/ycb_banana.obj", "m"], ["organised/mosd_learn36_cylinders.pcd", "m"],
  ["faces/rvcg_humface.ply", "mm"], ["organised/stanford_bun000.ply", "m"], ["patches/neon_side_panel.off", "mm"],
];
const long = {};

/** Drops a scan and makes its surface; `words` are the times, and what the library says of its own. */
async function surface(server, path, unit, tolerance = "") {
  const { page, done } = await open(server);
  const dropped = performance.now();
  await drop(page, path);
  await page.waitForSelector("#files li");
  const seen = (performance.now() - dropped) / 1000;
  await idle(page);
  await chosenUnit(page, unit);
  await page.fill("#tolerance", tolerance);
  const begun = performance.now();
  await fit(page, 900_000);
  const seconds = (performance.now() - begun) / 1000;
  const words = `points after ${seen.toFixed(1)} s, surface ${seconds.toFixed(1)} s (library ${await figure(page, "Time")}), ${await figure(page, "Memory")}`;
  return { page, done, seconds, words };
}

/** The same on an isolated page. */
async function isolated(test) {
  const own = await serve(dist, { isolated: true });
  try {
    return await test(own);
  } finally {
    await own.close();
  }
}

long["a cloud of 1 M points becomes a surface"] = async (server) => {
  const path = cloud(1e6);
  const once = async (at) => {
    const { page, done, words } = await surface(at, path, "mm", "0.1");
    expect(await page.locator("#verdict").textContent() === "Passed", await page.locator("#reason").textContent());
    await done();
    return words;
  };
  return `${await once(server)}\n        isolated: ${await isolated(once)}`;
};

for (const [name, unit] of SCANS) {
  long[`the STEP file of ${name} is that of the command`] = async (server) => {
    const path = scanOf(name);
    const { page, done, seconds, words } = await surface(server, path, unit);
    await shot(page, basename(name));
    const step = readFileSync(await saved(page, "step"), "latin1");
    await done();
    const command = ofCommand(path, unit);
    const said = `${words}, command ${command.seconds.toFixed(1)} s (x${(seconds / command.seconds).toFixed(1)})`;
    expect(readFileSync(command.to, "latin1") === step, `other bytes than those of the command; ${said}`);
    return `${said}\n        isolated: ${await isolated(async (at) => {
      const other = await surface(at, path, unit);
      expect(readFileSync(await saved(other.page, "step"), "latin1") === step, "another file on the isolated page");
      await other.done();
      return other.words;
    })}`;
  };
}

let failed = 0;
const server = await serve(dist);
for (const [name, test] of Object.entries({ ...tests, ...(options.short ? {} : long) })) {
  if (wanted.length && !wanted.some((word) => name.includes(word))) continue;
  const begun = performance.now();
  let line = "ok     ", note;
  try {
    note = await test(server) ?? "";
  } catch (error) {
    line = error instanceof Skipped ? "skipped" : "FAILED ";
    failed += error instanceof Skipped ? 0 : 1;
    note = error.message.split("\n").slice(0, 6).join("\n        ");
  }
  console.log(`${line} ${name} (${((performance.now() - begun) / 1000).toFixed(1)} s)${note ? `\n        ${note}` : ""}`);
}
await browser.close();
await server.close();
rmSync(work, { recursive: true, force: true });
process.exit(failed ? 1 : 0);
