// Opens report pages in headless Chromium, from a file, and checks that they work.
//
//   node pages.mjs [--shots FOLDER] [--chromium PATH] REPORT.html...
//
// Prints one line per page; the exit status is 1 if any fails. WebGL is drawn in software, so no graphics card is needed.

import { copyFileSync, mkdirSync, mkdtempSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join, resolve } from "node:path";
import { parseArgs } from "node:util";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";
import { FLAGS } from "./browser.mjs";

const WIDE = { width: 1200, height: 750 }, NARROW = { width: 360, height: 740 };

const { values: options, positionals: reports } = parseArgs({
  allowPositionals: true,
  options: { shots: { type: "string" }, chromium: { type: "string", default: "/usr/bin/chromium" } },
});
if (!reports.length) {
  console.error("usage: node pages.mjs [--shots FOLDER] [--chromium PATH] REPORT.html...");
  process.exit(2);
}
if (options.shots) mkdirSync(options.shots, { recursive: true });

const profile = mkdtempSync(join(tmpdir(), "nurbskin-pages-"));
const browser = await chromium.launchPersistentContext(profile, {
  executablePath: options.chromium, headless: true, chromiumSandbox: false, args: FLAGS, viewport: WIDE, reducedMotion: "reduce",
});
let failed = 0, inspected = false, tried = false;
for (const report of reports) {
  const from = Date.now(), faults = [];
  try {
    await check(report, faults);
  } catch (error) {
    faults.push(error.message.split("\n")[0]);
  }
  const seconds = ((Date.now() - from) / 1000).toFixed(1);
  console.log(`${faults.length ? "FAILED" : "ok    "} ${basename(report)} (${seconds} s)${faults.map((f) => `\n       ${f}`).join("")}`);
  failed += faults.length ? 1 : 0;
}
await browser.close();
rmSync(profile, { recursive: true, force: true });
process.exit(failed ? 1 : 0);

async function check(report, faults) {
  const expect = (good, what) => good || faults.push(what);
  const page = await open(report, faults, WIDE);
  const shot = (name, of = page, fullPage = true) => options.shots && of.screenshot({ path: join(options.shots, `${basename(report, ".html")}-${name}.png`), fullPage });
  const about = await page.evaluate(() => {
    const { modes, layers, data, drawn } = window.nurbskin;
    return { modes, layers, drawn, worst: data.worst.length, kind: data.kind, tolerance: !!data.tolerance, deviation: !!(data.mesh?.deviation ?? data.points?.deviation), faces: !!data.mesh };
  });
  expect(about.drawn, "there is no 3-D view");
  await shot("wide");

  const bare = await page.evaluate(() => window.nurbskin.data.statistics?.surface_to_scan?.unsupported_area ?? 0);
  expect((await page.locator("#key-figures .mind").count() === 1) === bare > 0.05, `${bare} of the area is without data, and this is not said rightly`);

  // The picture, fitted to all.
  const seen = await inView(page);
  expect(seen.surface === 1 && seen.points > 0.9, `the view does not show all: ${JSON.stringify(seen)}`);
  await page.click("[data-view=fit]");
  await settled(page);
  expect((await inView(page)).points > 0.9, "Fit leaves the points out");
  const first = await look(page), colours = await coloursOf(page);
  expect(colours > 40, `the canvas is all but blank: ${colours} colours`);
  const frames = await page.evaluate(() => window.nurbskin.frames());
  await page.waitForTimeout(300);
  expect(await page.evaluate(() => window.nurbskin.frames()) === frames, "it draws while nothing changes");
  if (about.kind !== "view") expect(about.deviation && about.modes[0] === "deviation", "a report does not begin with the deviation");

  // Every mode and toggle, by the controls that people use.
  const start = await page.inputValue("#mode"), points = page.locator("[data-layer=points]");
  for (const mode of about.modes.filter((m) => m !== start)) {
    await page.selectOption("#mode", mode);
    expect(await differ(page, await look(page), first) > 20, `mode ${mode} changes nothing`);
    if (["zebra", "mean"].includes(mode)) await shot(mode);
  }
  await page.selectOption("#mode", start);
  expect(await differ(page, await look(page), first) === 0, "the first mode again is not as before");
  if (about.deviation) {
    const map = await page.inputValue("#map");
    expect((map === "tolerance") === about.tolerance, "the scale is not that of the tolerance where there is one");
    await page.selectOption("#map", "jet");
    expect(await differ(page, await look(page), first) > 20, "the map changes nothing");
    await shot("jet");
    if (about.tolerance) {
      await page.selectOption("#map", "diverging");
      expect(await differ(page, await look(page), first) > 20, "the scale of the tolerance is as any other");
    }
    await page.selectOption("#map", map);
    expect(await differ(page, await look(page), first) === 0, "the first map again is not as before");
  }
  for (const layer of about.layers) {
    const needs = layer === "rejected" && await points.getAttribute("aria-pressed") === "false" ? points : null;
    await needs?.click();
    const before = needs ? await look(page) : first, button = page.locator(`[data-layer=${layer}]`), was = await button.getAttribute("aria-pressed");
    await button.click();
    const changed = await differ(page, await look(page), before) > 20;
    expect(await button.getAttribute("aria-pressed") !== was, `toggle ${layer} does not say whether it is on`);
    await button.click();
    expect(await differ(page, await look(page), before) === 0, `toggle ${layer} twice is not as before`);
    expect(changed || await seenFrom(page, button, ["back", "left", "bottom"]), `toggle ${layer} changes nothing`);
    await needs?.click();
  }
  if (about.deviation) {
    const limit = await page.inputValue("#limit");
    await page.fill("#limit", String(Number(limit) / 3));
    await page.press("#limit", "Enter");
    expect(await differ(page, await look(page), first) > 20, "the limit of the scale changes nothing");
    await page.fill("#limit", "nonsense");
    await page.press("#limit", "Enter");
    expect(await page.getAttribute("#limit", "aria-invalid") === "true", "a limit that is no number is taken");
    await page.locator("#presets button").first().click();
  }

  if (await page.isVisible("#log")) {
    const before = await page.locator("#histogram .chart").innerHTML();
    await page.check("#log");
    expect(await page.locator("#histogram .chart").innerHTML() !== before, "logarithmic counts change nothing");
  }
  const trade = await page.evaluate(() => window.nurbskin.data.trade);
  expect(await page.isVisible("#trade") === !!trade, "the curve of control points is not where it has points");
  if (trade) expect(await page.locator("#trade .taken").count() === 2, "the surface is not on the curve, or not in its key");
  if (about.kind === "view") expect(await page.isVisible("#no-deviation"), "nothing says why there is no deviation");

  // The camera, by mouse and keys.
  await moves(page, expect, "the wheel", () => page.mouse.wheel(0, -240));
  await moves(page, expect, "an arrow key", () => page.press("#canvas", "ArrowLeft"));
  await moves(page, expect, "a drag", async () => {
    const { x, y } = await middle(page);
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 60, y + 30, { steps: 3 });
    await page.mouse.up();
  });
  const before = await look(page);
  await page.click("#perspective");
  expect(await differ(page, await look(page), before) > 20, "the parallel projection changes nothing");
  await page.click("#perspective");
  await moves(page, expect, "the top view", () => page.click("[data-view=top]"));
  await moves(page, expect, "the iso view", () => page.click("[data-view=iso]"));

  // What is pointed at: somewhere near the middle there is something.
  expect(await readsOut(page), "pointing at the middle reads nothing out");
  await shot("hover", page, false);
  if (about.worst) {
    await moves(page, expect, "a worst place", () => page.click("#worst tbody button"));
    expect(await page.locator(".chosen").count() === 1, "the worst place is not marked");
    const at = await page.evaluate(() => {
      const { data, locate } = window.nurbskin, canvas = document.getElementById("canvas");
      const [x, y] = locate(data.worst[0].point);
      return [x / canvas.clientWidth, y / canvas.clientHeight];
    });
    expect(at.every((x) => x > 0.25 && x < 0.75), "the worst place is not in the middle of the view");
    await shot("worst");
  }
  if (about.layers.includes("points") && about.faces) {
    await page.click("[data-view=iso]");
    if (await points.getAttribute("aria-pressed") === "false") await points.click();
    await settled(page);
    await page.evaluate(() => document.getElementById("point-size").scrollIntoView({ block: "nearest" }));
    expect(await readsOut(page, "point"), "no point of the scan is read out");
    await shot("points");
  }
  await figures(page, expect);
  await joins(page, expect, shot);
  // Where the scan is far off its part, the surface has no deviation and is a dot on the screen.
  const measured = about.deviation && await page.evaluate(() => window.nurbskin.data.mesh.deviation.some(Number.isFinite));
  if (about.faces && measured && !inspected) {
    inspected = true;
    await tools(page, expect, faults, shot);
  }
  const pdf = await page.pdf({ format: "A4", ...(options.shots ? { path: join(options.shots, `${basename(report, ".html")}.pdf`) } : {}) });
  expect(pdf.length > 20000, "printing gives an empty document");
  // What was done is folded on the screen, and there on paper, which has no controls and cuts nothing off.
  await onPaper(page, expect);
  expect(await page.evaluate(() => document.getElementById("snapshot").src.length > 5000), "the picture is not printed");
  const sides = await page.evaluate(() => [...document.querySelectorAll("#print-views img")].map((image) => image.src));
  expect(sides.length === 4 && new Set(sides).size > 1 && sides.every((src) => src.length > 2000), "the sides of the part are not printed");
  await page.close();

  const narrow = await open(report, faults, NARROW);
  const over = await narrow.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  expect(over <= 0, `a narrow window scrolls sideways by ${over} pixels`);
  const cut = await narrow.evaluate(() => [...document.querySelectorAll("#tables .scroll, #wide-tables .scroll")].filter((e) => e.scrollWidth > e.clientWidth)
    .map((e) => e.closest(".card").querySelector("h3").innerText));
  expect(!cut.length, `tables that a narrow window cuts: ${cut.join(", ")}`);
  await shot("narrow", narrow);
  await narrow.close();

  // The first view of a large window shows all, before anything is pressed.
  const large = await open(report, faults, { width: 1500, height: 1000 });
  const whole = await inView(large);
  expect(whole.surface === 1 && whole.points > 0.9, `the first view of a large window is cut off: ${JSON.stringify(whole)}`);
  const reasons = await large.evaluate(() => window.nurbskin.data.verdict?.reasons ?? []);
  expect(await large.locator("#verdict li").count() === reasons.length, "the reasons of the verdict are not all there");
  for (const [k] of reasons.filter(({ where }) => where).entries()) {
    await moves(large, expect, "the place of a reason", () => large.locator("#verdict li button").nth(k).click());
    await large.click("[data-view=iso]");
  }
  await large.close();

  const dark = await open(report, faults, WIDE, { dark: true });
  expect(await coloursOf(dark) > 40, "the canvas is all but blank in the dark");
  await shot("dark", dark);
  await dark.close();

  if (!tried) await hardships(report, expect, faults);
  tried = true;

  const flat = await open(report, faults, WIDE, { flat: true });
  expect(/WebGL 2/.test(await flat.innerText("#no-view")), "nothing says that WebGL 2 is missing");
  expect(await flat.locator("#tables table").count() > 0 || about.kind === "view", "without WebGL 2 the tables are missing");
  await shot("flat", flat);
  await flat.close();
}

// On paper nothing is folded or cut off, and there are no buttons; afterwards all is as before.
async function onPaper(page, expect) {
  const folded = () => page.locator("details.card:not([open])").count(), before = await folded();
  await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
  await page.emulateMedia({ media: "print" });
  expect(await folded() === 0, "what is folded stays so on paper");
  const seen = await page.evaluate(() => ({
    buttons: [...document.querySelectorAll("button:not(th button)")].filter((b) => b.checkVisibility() && !b.matches(".plain")).map((b) => b.textContent),
    cut: [...document.querySelectorAll(".scroll")].filter((box) => box.checkVisibility() && getComputedStyle(box).overflowX !== "visible").length,
  }));
  expect(!seen.buttons.length, `buttons are printed: ${seen.buttons.join(", ")}`);
  expect(!seen.cut, `${seen.cut} tables would be cut off on paper`);
  await page.emulateMedia({ media: null });
  await page.evaluate(() => dispatchEvent(new Event("afterprint")));
  expect(await folded() === before, "after printing other cards are unfolded than before");
}

// The figures of the heading, the tables and the histogram.
async function figures(page, expect) {
  const found = await page.evaluate(() => {
    const { data } = window.nurbskin, colours = [...document.querySelectorAll("#histogram rect")].map((bar) => ({ fill: bar.getAttribute("fill"), text: bar.textContent }));
    return {
      colours, fields: data.fields.map(({ key, text }) => [key.toLowerCase(), text]), tolerance: data.tolerance, statistics: data.statistics?.scan_to_surface,
      shown: [...document.querySelectorAll("#fields div")].map((div) => [div.children[0].textContent.toLowerCase(), div.children[1].textContent]),
      key: document.getElementById("key-figures").innerText, rows: [...document.querySelectorAll("#tables tr")].map((row) => row.innerText),
    };
  });
  expect(JSON.stringify(found.fields) === JSON.stringify(found.shown), `the fields are not as they were given: ${found.shown.join("; ")}`);
  if (!found.statistics) return;
  for (const name of ["Mean d", "Std. deviation"]) expect(found.key.includes(name), `the heading has no ${name}`);
  expect(found.rows.some((row) => row.startsWith("Above +tolerance")) === !!found.tolerance, "the counts above the tolerance are not where there is one");
  if (!found.tolerance) return;
  // Green within the tolerance, and only there.
  const green = (fill) => { const [r, g, b] = fill.match(/\d+/g).map(Number); return g > r && g > b; };
  const bars = await page.evaluate(() => {
    const { data, settings } = window.nurbskin, { low, high, counts } = data.histogram, width = (high - low) / counts.length;
    if (settings.scale?.map !== "tolerance") return [];
    const places = counts.flatMap((n, k) => (n ? [low + (k + 0.5) * width] : []));
    const rects = [...document.querySelectorAll("#histogram rect")].slice(0, places.length).map((bar) => bar.getAttribute("fill"));
    return places.map((place, k) => ({ within: Math.abs(place) <= data.tolerance, fill: rects[k] }));
  });
  expect(bars.every(({ within, fill }) => !fill?.startsWith("rgb") || green(fill) === within), "the histogram is not green within the tolerance, or is beyond it");
}

// Faces, and how they join.
async function joins(page, expect, shot) {
  const about = await page.evaluate(() => {
    const { data } = window.nurbskin, smooth = data.joins.filter((join) => join.kind === "smooth");
    return { faces: data.faces.length, smooth: smooth.length, sharp: data.joins.filter((join) => join.kind === "sharp").length, largest: Math.max(...smooth.map((join) => join.bound ?? join.sampled)) };
  });
  if (about.faces < 2) return;
  const [faces, edges] = [page.locator("#wide-tables table").nth(0), page.locator("#wide-tables table").nth(1)];
  expect(await faces.locator("tbody tr").count() === about.faces, "a face is missing in the table");
  const order = () => faces.locator("tbody th").allInnerTexts(), before = await order();
  await faces.locator("thead button").first().click();
  expect((await order()).join() !== before.join(), "the table of faces is not sorted by a click");
  if (!about.smooth) return;
  expect(await edges.locator("tbody tr").count() === about.smooth, "an edge is missing in the table");
  const first = Number(await edges.locator("tbody tr").first().locator("td").nth(1).innerText());
  expect(Math.abs(first / about.largest - 1) < 0.06, `the largest angle is ${about.largest}, and ${first} comes first`);
  await moves(page, expect, "an edge of the table", () => edges.locator("tbody button").first().click());
  await moves(page, expect, "a face of the table", () => faces.locator("tbody button").first().click());
  await page.click("[data-view=iso]");
  await page.selectOption("#mode", "jumps");
  const counts = (await page.locator("#legend .swatch").allInnerTexts()).filter((text) => text.includes("°")).map((text) => Number(text.split(":")[1]));
  expect(counts.reduce((a, b) => a + b, 0) === about.smooth, `the legend counts ${counts} of ${about.smooth} smooth edges`);
  expect(await page.locator("[data-layer=features]").count() === (about.sharp ? 1 : 0), "feature lines are not where there are sharp edges");
  // The edge that is pointed at: the middle of the longest one that faces the eye.
  const text = await pointedEdge(page);
  expect(/edge/.test(text ?? "") && /°/.test(text ?? ""), `an edge is not read out: ${text}`);
  await shot("jumps");
  const modes = await page.evaluate(() => window.nurbskin.modes);
  if (modes.includes("by_face")) {
    await page.selectOption("#mode", "by_face");
    await shot("faces");
  }
  await page.selectOption("#mode", modes[0]);
}

// Points at the middle of edges until one is read out.
async function pointedEdge(page) {
  const places = await page.evaluate(() => {
    const { data, locate } = window.nurbskin, { positions, lengths } = data.lines.edges, found = [];
    let start = 0;
    for (const [k, length] of lengths.entries()) {
      const i = 3 * (start + Math.floor(length / 2));
      if (data.joins[k].kind === "smooth") found.push(locate(data.origin.map((at, d) => at + positions[i + d])));
      start += length;
    }
    return found.slice(0, 40);
  });
  const { x, y, width, height } = await middle(page);
  for (const [a, b] of places) {
    await page.mouse.move(x - width / 2 + a, y - height / 2 + b);
    await page.waitForTimeout(60);
    const text = await page.locator("#readout").isVisible() && await page.locator("#readout").innerText();
    if (text && /normals turn/.test(text)) return text;
  }
  return null;
}

// Section, distance, notes, and what is saved.
async function tools(page, expect, faults, shot) {
  await page.click("[data-view=iso]");
  const before = await look(page);
  await page.click("#section");
  await settled(page);
  const cut = () => page.locator("#section-plot .cut").getAttribute("d"), share = () => page.evaluate(() => window.nurbskin.section.state.share);
  expect(await differ(page, await look(page), before) > 200, "a section cuts nothing away");
  expect(await page.locator("#section-plot .whisker").count() > 10, "the section has no whiskers");
  for (const plane of ["y", "z", "view", "x"]) {
    const was = await cut();
    await page.selectOption("#section-plane", plane);
    await settled(page);
    expect(await cut() !== was, `the plane ${plane} cuts as the one before`);
  }
  // Every end of the curve lies in the plane, and closed surfaces have closed curves.
  const off = await page.evaluate(() => {
    const { section } = window.nurbskin, { normal, offset } = section.state, size = window.nurbskin.data.bounds.size;
    return Math.max(...section.segments.flat().map(({ point }) => Math.abs(point.reduce((sum, x, k) => sum + x * normal[k], -offset)))) / size;
  });
  expect(off < 1e-5, `the curve of the section is off its plane by ${off} of the size`);
  const placed = await share(), was = await cut();
  await page.locator("#section-place").fill("300");
  await settled(page);
  expect(await share() !== placed && await cut() !== was, "the slider does not move the plane");
  await page.evaluate(() => document.getElementById("canvas").scrollIntoView({ block: "center" }));
  const handle = await page.locator(".handle").boundingBox(), start = await share();
  await page.mouse.move(handle.x + handle.width / 2, handle.y + handle.height / 2);
  await page.mouse.down();
  await page.mouse.move(handle.x + handle.width / 2 + 40, handle.y + handle.height / 2 + 20, { steps: 3 });
  await page.mouse.up();
  expect(Math.abs(await share() - start) > 0.01, "the handle does not drag the plane");
  await shot("section");
  const kept = await look(page);
  await page.uncheck("#section-away");
  expect(await differ(page, await look(page), kept) > 100, "nothing is back that was cut away");
  await page.check("#section-away");
  await page.click("#section");
  expect(await differ(page, await look(page), before) === 0, "without the section it is not as before");

  // Two places that are seen, and what is there. The tool first: its words may take a line from the view.
  await page.click("#distance");
  await settled(page);
  const places = await page.evaluate(() => {
    const { pick } = window.nurbskin, { clientWidth: w, clientHeight: h } = document.getElementById("canvas"), found = [];
    for (let k = 0; k < 400 && found.length < 2; k++) {
      const at = [(0.1 + 0.8 * ((k * 0.618) % 1)) * w, (0.1 + 0.8 * ((k * 0.414) % 1)) * h], there = pick(...at);
      if (there && (!found.length || Math.hypot(at[0] - found[0].at[0], at[1] - found[0].at[1]) > 60)) found.push({ at, position: there.position });
    }
    return found;
  });
  // Where a place is now: other words give the line back.
  const press = async ({ position }) => {
    await settled(page);
    const { x, y, width, height } = await middle(page), at = await page.evaluate((place) => window.nurbskin.locate(place), position);
    await page.mouse.click(x - width / 2 + at[0], y - height / 2 + at[1]);
  };
  for (const place of places) await press(place);
  await page.keyboard.press("Escape");
  await page.click("#distance");
  const items = await page.evaluate(() => window.nurbskin.marks.items);
  const far = (points) => Math.hypot(...points[0].map((x, k) => x - points[1][k])), [asked, got] = [far(places.map((p) => p.position)), items.length ? far(items[0].points) : NaN];
  expect(Math.abs(got / asked - 1) < 0.02, `the distance is ${got}, not ${asked}`);
  await page.click("#note");
  await press(places[0]);
  await page.locator("#marks textarea").fill("A dent </script> & <b>more</b>");
  expect(await page.locator("#overlay .mark").count() === 2, "a distance and a note are not drawn");
  await shot("marks");
  const copy = await page.evaluate(() => window.nurbskin.copy()), folder = mkdtempSync(join(tmpdir(), "nurbskin-copy-")), file = join(folder, "copy.html");
  writeFileSync(file, copy);
  const again = await open(file, faults, WIDE);
  expect(await again.locator("#marks textarea").inputValue() === "A dent </script> & <b>more</b>", "the copy of the page has another note");
  expect(JSON.stringify(await again.evaluate(() => window.nurbskin.marks.items.map((m) => m.points))) === JSON.stringify(await page.evaluate(() => window.nurbskin.marks.items.map((m) => m.points))), "the copy of the page has other marks");
  expect(await again.evaluate(() => window.nurbskin.copy()) === copy, "a copy of the copy differs");
  await again.close();
  for (const [id, ending, least] of [["save-picture", ".png", 20000], ["save-csv", ".csv", 1000], ["save-page", ".html", 50000]]) {
    const [download] = await Promise.all([page.waitForEvent("download"), page.click(`#${id}`)]), saved = join(folder, `saved${ending}`);
    await download.saveAs(saved);
    expect(download.suggestedFilename().endsWith(ending) && statSync(saved).size > least, `#${id} saves ${download.suggestedFilename()} of ${statSync(saved).size} bytes`);
  }
  if (options.shots) copyFileSync(join(folder, "saved.png"), join(options.shots, "saved.png"));
  const [lines, total, absent] = await page.evaluate(() => { const { data: { points }, csv } = window.nurbskin; return [csv().trim().split("\n"), points.count, points.notFinite.length]; });
  expect(lines.length === 1 + total + absent, `the CSV has ${lines.length} lines for ${total} points and ${absent} that are not finite`);
  expect(lines.every((line) => line.split(",").length === 10), "a line of the CSV has another number of columns");
  expect(lines.slice(1).every((line) => ["used", "held_out", "outlier", "left_out", "duplicate", "not_finite"].includes(line.split(",")[9])), "a point of the CSV has no state");
  while (await page.locator("#marks li").count()) await page.locator("#marks button").first().click();
  expect(await differ(page, await look(page), before) === 0, "without the marks it is not as before");
  rmSync(folder, { recursive: true, force: true });
}

// A page whose faults are noted: requests, messages in the console, errors.
async function open(report, faults, viewport, { dark = false, flat = false } = {}) {
  const page = await browser.newPage();
  await page.setViewportSize(viewport);
  await page.emulateMedia({ colorScheme: dark ? "dark" : "light", reducedMotion: "reduce" });
  if (flat) {
    await page.addInitScript(() => {
      const get = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind === "webgl2" ? null : get.call(this, kind, ...rest); };
    });
  }
  page.on("request", (r) => /^(file|data|blob):/.test(r.url()) || faults.push(`asks for ${r.url()}`));
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && !/GPU stall due to ReadPixels/.test(m.text()) && faults.push(`console: ${m.text()}`));
  page.on("pageerror", (e) => faults.push(`error: ${e.message}`));
  await page.goto(pathToFileURL(resolve(report)).href);
  if (!(await page.evaluate(() => window.nurbskin?.ready))) faults.push(`not ready: ${await page.innerText("#trouble")}`);
  await settled(page);
  return page;
}

// A graphics card that is lost and comes back, and a browser that cannot unpack the page.
async function hardships(report, expect, faults) {
  const page = await open(report, faults, WIDE), before = await look(page);
  await page.evaluate(async () => {
    const canvas = document.getElementById("canvas"), card = canvas.getContext("webgl2").getExtension("WEBGL_lose_context");
    const told = (name) => new Promise((done, fail) => {
      canvas.addEventListener(name, done, { once: true });
      setTimeout(() => fail(new Error(`no event ${name}`)), 10_000);
    });
    const lost = told("webglcontextlost");
    card.loseContext();
    await lost;
    // It cannot come back before all have been told that it is lost.
    await new Promise((done) => { setTimeout(done, 50); });
    const back = told("webglcontextrestored");
    card.restoreContext();
    await back;
  });
  expect(await differ(page, await look(page), before) === 0, "a graphics card that comes back draws another picture");
  await page.close();
  const old = await browser.newPage();
  await old.addInitScript(() => { delete window.DecompressionStream; });
  await old.goto(pathToFileURL(resolve(report)).href);
  await old.evaluate(() => window.nurbskin.ready);
  expect(/too old/.test(await old.innerText("#trouble")), "nothing says that the browser is too old");
  await old.close();
}

// Waits until nothing is about to change.
async function settled(page) {
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  await page.waitForFunction(() => window.nurbskin.resting());
}

// The canvas with what lies over and beside it, as the screen has it; from the same place, as lines fall on other pixels
// where the page is scrolled by parts of one.
async function look(page) {
  await page.mouse.move(2, 2);
  await page.evaluate(() => scrollTo(0, 0));
  await settled(page);
  return (await page.locator("#stage").screenshot()).toString("base64");
}

// How many pixels of two pictures differ by more than the rounding of what puts layers together.
async function differ(page, first, second) {
  return page.evaluate(async (texts) => {
    const [a, b] = await Promise.all(texts.map(pixelsOf));
    async function pixelsOf(text) {
      const image = new Image();
      image.src = `data:image/png;base64,${text}`;
      await image.decode();
      const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height).data;
    }
    if (a.length !== b.length) return Infinity;
    let found = 0;
    for (let i = 0; i < a.length; i += 4) if (Math.abs(a[i] - b[i]) + Math.abs(a[i + 1] - b[i + 1]) + Math.abs(a[i + 2] - b[i + 2]) > 12) found++;
    return found;
  }, [first, second]);
}

// Which part of the surface and of the points that count is within the canvas.
async function inView(page) {
  return page.evaluate(() => {
    const { data, locate } = window.nurbskin, { clientWidth: width, clientHeight: height } = document.getElementById("canvas");
    const part = (set) => {
      let inside = 0, all = 0;
      for (let i = 0; i + 2 < (set?.positions.length ?? 0); i += 3) {
        if (set.state?.[i / 3] >= 3) continue;
        const [x, y] = locate(data.origin.map((at, k) => at + set.positions[i + k]));
        inside += x >= 0 && x <= width && y >= 0 && y <= height ? 1 : 0;
        all++;
      }
      return all ? inside / all : 1;
    };
    return { surface: part(data.mesh), points: part(data.points) };
  });
}

// Whether a toggle changes the picture from any of these sides: seams, edges and holes may be behind the surface.
async function seenFrom(page, button, sides) {
  for (const side of sides) {
    await page.click(`[data-view=${side}]`);
    const before = await look(page);
    await button.click();
    const changed = await differ(page, await look(page), before) > 20;
    await button.click();
    await page.click("[data-view=iso]");
    if (changed) return true;
  }
  return false;
}

// How many colours the middle half of the canvas has.
async function coloursOf(page) {
  const bytes = await page.locator("#picture").screenshot();
  return page.evaluate(async (text) => {
    const image = new Image();
    image.src = `data:image/png;base64,${text}`;
    await image.decode();
    const { width, height } = image, context = new OffscreenCanvas(width, height).getContext("2d");
    context.drawImage(image, 0, 0);
    const middle = context.getImageData(width / 4, height / 4, width / 2, height / 2);
    return new Set(new Uint32Array(middle.data.buffer)).size;
  }, bytes.toString("base64"));
}

async function middle(page) {
  await page.locator("#canvas").scrollIntoViewIfNeeded();
  const box = await page.locator("#canvas").boundingBox();
  return { x: box.x + box.width / 2, y: box.y + box.height / 2, ...{ width: box.width, height: box.height } };
}

async function moves(page, expect, what, doing) {
  const { x, y } = await middle(page);
  await page.mouse.move(x, y);
  const pose = () => page.evaluate(() => JSON.stringify(window.nurbskin.camera()));
  const before = await pose();
  await doing();
  await settled(page);
  expect(await pose() !== before, `${what} does not move the camera`);
}

// Points at places from the middle outwards, then at what is drawn, until something is read out (of a kind, if one is
// asked for).
async function readsOut(page, kind) {
  const { x, y, width, height } = await middle(page), places = [];
  for (let k = 0; k < 60; k++) {
    const r = 0.45 * (k / 60);
    places.push([x + r * width * Math.cos(2.4 * k), y + r * height * Math.sin(2.4 * k)]);
  }
  const drawn = await page.evaluate(() => {
    const { data, locate } = window.nurbskin, found = [];
    for (const set of [data.mesh, data.points].filter(Boolean)) for (let k = 0; k < 10; k++) {
      const i = 3 * Math.floor((k + 0.5) / 10 * set.positions.length / 3);
      found.push(locate(data.origin.map((at, d) => at + set.positions[i + d])));
    }
    return found;
  });
  places.push(...drawn.map(([a, b]) => [x - width / 2 + a, y - height / 2 + b]));
  for (const [k, at] of places.entries()) {
    await page.mouse.move(...at);
    await page.waitForTimeout(k ? 40 : 150);
    const text = await page.locator("#readout").isVisible() && await page.locator("#readout").innerText();
    if (text && /\d/.test(text) && (!kind || text.toLowerCase().startsWith(kind))) return text;
  }
  return null;
}
