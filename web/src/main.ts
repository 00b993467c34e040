// The page: files in, settings, result, files out. The worker computes, the viewer draws.

import "./style.css";
import type { CompareOptions, ComparisonFigures, FitFigures, FitOptions, Look, Scene, UnitName } from "nurbskin";
import { BEYOND, gradient, sub, size, type Layer, type Viewer } from "nurbskin-viewer";
import { histogramChart, tradeChart } from "./charts";
import { button, download, element, make } from "./dom";
import { beginOf, Engine, TaskError, type Listener } from "./engine";
import { EXAMPLES, type Example } from "./examples";
import { isProject, readProject, writeProject, type Project } from "./project";
import type { Cost } from "./protocol";
import { LAYERS, MODES, drawingOf, hasLayer, hasMode, lengthsOf, liftOf, openViewer, pinOf, scaleOf, type Marker, type Mode, type Shown } from "./view";
import {
  bytesWords, counted, digits, failureWords, grouped, lengthWords, pictured, plain, readTolerance, sentence, sizeWords, stageWords,
  UNITS, verdictWords,
} from "./words";

/** A file of the user, or an example. */
interface Opened {
  id: number;
  name: string;
  content: Blob;
  look: Look;
}

type Done =
  | { kind: "fit"; scan: Opened; options: FitOptions; figures: FitFigures; scene: Scene; cost: Cost; generation: number }
  | { kind: "compare"; scan: Opened; cad: Opened; options: CompareOptions; figures: ComparisonFigures; scene: Scene; cost: Cost; generation: number };

/** Projects are small; a file larger than this is none. */
const LARGEST_PROJECT = 100_000;
/** Formats of the surface, with what they are for. */
const SAVES: [string, string][] = [
  ["step", "STEP"], ["igs", "IGES"], ["stl", "STL mesh"], ["glb", "GLB mesh"], ["html", "Report"], ["json", "Figures (JSON)"], ["csv", "Points (CSV)"],
];

const query = new URLSearchParams(location.search);
/** `?date=SECONDS`: the date in the headers of files, as SOURCE_DATE_EPOCH of the command, for files that can be compared. */
const date = Number(query.get("date") ?? NaN);

let files: Opened[] = [];
let generation = 0;
let nextFile = 1;
let scan: Opened | null = null;
let cad: Opened | null = null;
let unit: UnitName | null = null;
let done: Done | null = null;
let project: Project | null = null;
let markers: Marker[] = [];
/** Whether a task is shown as going on; there is one at a time. */
let working = false;

const engine = new Engine(
  {
    worker: () => {
      generation += 1;
      return new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    },
    thread: () => new Worker(new URL("./thread.ts", import.meta.url), { type: "module" }),
  },
  beginOf(query, navigator.hardwareConcurrency),
  async (id) => {
    const file = files.find((opened) => opened.id === id);
    if (!file) throw new TaskError({ kind: "invalid", message: "the file is closed" });
    return { name: file.name, bytes: await file.content.arrayBuffer() };
  },
);

let viewer: Viewer | null = null;
try {
  viewer = openViewer({ pin: visit });
} catch {
  element("view").replaceChildren(make("p", { class: "failure" }, "This browser has no WebGL, so that nothing is drawn. All else works."));
}

const say = (text: string): void => { element("said").textContent = text; };
const show = (id: string, shown: boolean): void => { element(id).hidden = !shown; };

function fail(error: unknown): void {
  if (error instanceof TaskError && error.failure.kind === "cancelled") {
    say("Cancelled.");
    return;
  }
  const text = error instanceof TaskError ? failureWords(error.failure) : error instanceof Error ? error.message : String(error);
  const place = element("failure");
  place.textContent = text;
  place.hidden = false;
  place.scrollIntoView({ block: "nearest" });
}

/** Runs a task with its progress over the view; false if it failed, or if another goes on. */
async function watched(task: (listener: Listener) => Promise<void>): Promise<boolean> {
  if (working) return false;
  working = true;
  show("failure", false);
  const bar = element<HTMLProgressElement>("progress"), note = element("stage-note");
  let length: number | null = null;
  const begun = performance.now();
  const clock = setInterval(() => {
    const seconds = Math.round((performance.now() - begun) / 1000);
    if (seconds >= 3) element("cancel").textContent = `Cancel (${seconds} s)`;
  }, 500);
  const listener: Listener = {
    stage(name, steps) {
      length = steps;
      element("stage-name").textContent = stageWords(name);
      note.textContent = "";
      bar.removeAttribute("value");
      say(stageWords(name));
    },
    advance(steps) {
      if (length !== null && length > 0) bar.value = Math.min(1, steps / length);
    },
    tell(text) { note.textContent = plain(text); },
  };
  element("stage-name").textContent = "Starting";
  bar.removeAttribute("value");
  note.textContent = "";
  element("cancel").textContent = "Cancel";
  show("working", true);
  refresh();
  try {
    await task(listener);
    return true;
  } catch (error) {
    fail(error);
    return false;
  } finally {
    clearInterval(clock);
    working = false;
    show("working", false);
    refresh();
  }
}

// ---- Files

async function openFiles(list: Iterable<File>): Promise<void> {
  for (const file of list) {
    // What goes on is for the files before.
    engine.cancel();
    while (working) await new Promise((done) => { setTimeout(done, 20); });
    if (file.size < LARGEST_PROJECT && /\.json$/i.test(file.name)) {
      const text = await file.text();
      if (isProject(text)) {
        try {
          openProject(readProject(text));
        } catch (error) {
          fail(error);
        }
        continue;
      }
    }
    const id = nextFile++;
    await watched(async (listener) => {
      const bytes = await file.arrayBuffer();
      const look = await engine.run<"look">({ do: "look", file: id, name: file.name, bytes }, listener);
      await add({ id, name: file.name, content: file, look });
    });
  }
}

async function openExample(example: Example): Promise<void> {
  const id = nextFile++;
  await watched(async (listener) => {
    const { look, bytes } = await engine.run<"simulate">({ do: "simulate", file: id, name: example.name, shape: example.shape, options: example.options }, listener);
    await add({ id, name: example.name, content: new Blob([bytes]), look: { ...look, unitSource: "file" } });
  });
}

async function add(opened: Opened): Promise<void> {
  files.push(opened);
  await checkProject(opened);
  if (opened.look.kind === "cad") cad = opened;
  else choose(opened);
  if (!scan || opened.look.kind === "scan") forgetResult(opened.look.scene);
  say(`${opened.name}: ${aboutWords(opened.look)}`);
  refresh();
}

function choose(opened: Opened): void {
  scan = opened;
  unit = opened.look.unitSource === "assumed" ? null : opened.look.unit;
  // The tolerance is typed in the unit of the part.
  element<HTMLSelectElement>("tolerance-unit").value = unit === "in" || unit === "ft" ? "in" : "mm";
}

function close(opened: Opened): void {
  files = files.filter((other) => other !== opened);
  void engine.run<"forget">({ do: "forget", file: opened.id }).catch(() => undefined);
  if (cad === opened) cad = null;
  if (scan === opened) {
    const other = files.find(({ look }) => look.kind === "scan");
    scan = null;
    if (other) choose(other);
  }
  const rest = scan ?? cad;
  if (rest) forgetResult(rest.look.scene);
  else {
    done = null;
    show("result", false);
  }
  refresh();
}

function forgetResult(scene: Scene): void {
  done = null;
  show("result", false);
  display(scene);
}

function aboutWords(look: Look): string {
  const size = look.boundingBox ? `, ${sizeWords(look.boundingBox, look.unit)}` : "";
  const numbers = look.kind === "cad" ? counted(look.faces ?? 0, "face", "faces")
    : look.triangles ? `mesh of ${grouped(String(look.points ?? 0))} points` : counted(look.points ?? 0, "point", "points");
  return `${look.format.toUpperCase()}, ${numbers}${look.unitSource === "assumed" ? "" : size}, ${bytesWords(look.bytes)}`;
}

// ---- Projects

function openProject(opened: Project): void {
  project = opened;
  const { options } = opened;
  if (options.unit && options.unit !== "auto") unit = options.unit;
  const tolerance = /^([\d.eE+-]+)(mm|um|in|thou|%)$/.exec(String(options.tolerance ?? ""));
  element<HTMLInputElement>("tolerance").value = tolerance?.[1] ?? "";
  if (tolerance?.[2]) element<HTMLSelectElement>("tolerance-unit").value = tolerance[2];
  const fit = options as FitOptions;
  for (const [id, value] of [["layout", fit.layout], ["sharp", fit.sharp], ["trim", fit.trim], ["schema", fit.stepSchema]] as const) {
    if (value !== undefined) element<HTMLSelectElement>(id).value = value;
  }
  element<HTMLInputElement>("align").checked = (options as CompareOptions).align ?? true;
  const names = opened.inputs.map(({ name }) => name).join(" and ");
  say(`Settings of the project are set. Drop ${names} now.`);
  const note = element("failure");
  note.textContent = `The settings of the project are set. Now drop ${names}.`;
  note.hidden = false;
}

/** Whether a file is that of the project that was opened before. */
async function checkProject(opened: Opened): Promise<void> {
  const wanted = project?.inputs.find(({ name }) => name === opened.name);
  if (!wanted) return;
  const { sha256 } = await engine.run<"identity">({ do: "identity", file: opened.id });
  if (sha256 !== wanted.sha256) {
    fail(new Error(`${opened.name} is not the file of the project: its content is different. The result will differ.`));
  } else if (project?.options.unit && project.options.unit !== "auto") {
    opened.look = { ...opened.look, unit: project.options.unit, unitSource: "option" };
  }
}

async function saveProject(of: Done): Promise<void> {
  const opened = of.kind === "fit" ? [of.scan] : [of.scan, of.cad];
  const inputs = [];
  for (const { id } of opened) inputs.push(await engine.run<"identity">({ do: "identity", file: id }));
  const text = writeProject({ nurbskinProject: 1, version: of.figures.nurbskin, made: of.kind, inputs, options: of.options });
  download(`${stem(of.scan.name)}.nurbskin.json`, new Blob([text], { type: "application/json" }));
}

// ---- Settings

const value = (id: string): string => element<HTMLSelectElement>(id).value;

/** The settings; `null` if one is wrong, which is then said. */
function settings(): { tolerance?: string; unit: UnitName } | null {
  const field = element<HTMLInputElement>("tolerance");
  const { tolerance, error } = readTolerance(field.value, value("tolerance-unit"));
  field.setAttribute("aria-invalid", String(error !== undefined));
  if (error !== undefined || !unit) {
    fail(new Error(error ?? "Choose the unit of the scan first."));
    if (error !== undefined) field.focus();
    return null;
  }
  return { unit, ...(tolerance === undefined ? {} : { tolerance }) };
}

async function makeSurface(): Promise<void> {
  const set = settings();
  const of = scan;
  if (!set || !of) return;
  const options: FitOptions = {
    ...set,
    layout: value("layout") as NonNullable<FitOptions["layout"]>,
    sharp: value("sharp"),
    trim: value("trim") as NonNullable<FitOptions["trim"]>,
    stepSchema: value("schema") as NonNullable<FitOptions["stepSchema"]>,
    ...(Number.isFinite(date) ? { date } : {}),
  };
  await fitAs(of, options);
}

async function fitAs(of: Opened, options: FitOptions): Promise<boolean> {
  return watched(async (listener) => {
    const { figures, scene, cost } = await engine.run<"fit">({ do: "fit", file: of.id, options }, listener);
    finish({ kind: "fit", scan: of, options, figures, scene, cost, generation });
  });
}

async function compareFiles(): Promise<void> {
  const set = settings();
  const of = scan, to = cad;
  if (!set || !of || !to) return;
  await compareAs(of, to, { ...set, align: element<HTMLInputElement>("align").checked });
}

async function compareAs(of: Opened, to: Opened, options: CompareOptions): Promise<boolean> {
  return watched(async (listener) => {
    const { figures, scene, cost } = await engine.run<"compare">({ do: "compare", file: of.id, cad: to.id, options }, listener);
    finish({ kind: "compare", scan: of, cad: to, options, figures, scene, cost, generation });
  });
}

// ---- Result

function finish(result: Done): void {
  done = result;
  display(result.scene);
  const { figures, scene } = result;
  const heading = element("verdict");
  heading.textContent = verdictWords(figures.verdict, result.kind);
  heading.className = figures.verdict;
  element("reason").textContent = sentence(figures.reason);
  const length = (x: number): string => lengthWords(scene.shown_in, x);
  const { scan_to_surface: away, surface_to_scan: back } = figures.deviation;
  const rows: [string, string][] = [
    ["95 % of the points are within", length(away.p95)],
    ["Largest distance", length(away.max)],
  ];
  if (away.within_tolerance !== null && figures.tolerance !== null) {
    rows.push([`Within the tolerance of ${length(figures.tolerance)}`, `${digits(100 * away.within_tolerance, 4)} %`]);
  }
  if (result.kind === "fit") {
    const { surface } = result.figures;
    const faces = surface.faces !== undefined ? `${counted(surface.faces, "face", "faces")}, ` : "";
    rows.push(["Surface", `${faces}${surface.control_points.join(" × ")} control points`]);
  } else if (result.figures.alignment) {
    const { rotation_deg, translation } = result.figures.alignment;
    rows.push(["Scan moved by", `${digits(rotation_deg)}° and ${length(Math.hypot(...translation))}`]);
  }
  if (back.unsupported_area > 0.001) rows.push(["Area without points", `${digits(100 * back.unsupported_area)} %`]);
  const { threads, bytes } = result.cost;
  rows.push(["Time", `${digits(figures.time.total ?? 0)} s${threads > 1 ? ` on ${threads} threads` : ""}`], ["Memory", bytesWords(bytes)]);
  element("figures").replaceChildren(...rows.flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)]));
  element("reasons").replaceChildren(...figures.reasons.map(({ what, next }) => {
    const item = make("li", {}, sentence(what));
    if (next) item.append(" ", make("span", { class: "next" }, sentence(next)));
    return item;
  }));
  const own = stem(result.scan.name);
  const formats = SAVES.filter(([extension]) => result.kind === "fit" || ["html", "json", "csv"].includes(extension));
  element("saves").replaceChildren(
    ...formats.map(([extension, label]) => button(label, () => void save(`${own}.${extension}`), { "data-save": extension })),
    button("Project", () => void saveProject(result).catch(fail), { "data-save": "project", title: "Files' hashes, settings and version, to do it again" }),
  );
  showTrade(result);
  showHistogram(scene);
  showPlaces(result);
  showChecks(result);
  const notes = [...figures.warnings, ...scene.details].map((text) => make("li", {}, sentence(text)));
  element("notes").replaceChildren(...notes);
  show("notes-section", notes.length > 0);
  element("tables").replaceChildren(...scene.tables.map(({ title, rows: cells }) => make(
    "table", {}, make("caption", {}, title),
    make("tbody", {}, ...cells.map(([name = "", ...rest]) => make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, rest.join("  "))))),
  )));
  show("result", true);
  say(`${heading.textContent}. ${element("reason").textContent}`);
  heading.focus({ preventScroll: true });
  // Beside the view the panel scrolls alone; below it, the view stays in sight.
  if (matchMedia("(min-width: 52.01rem)").matches) heading.scrollIntoView({ block: "start" });
}

function stem(name: string): string {
  return name.replace(/\.gz$/i, "").replace(/\.[^.]+$/, "");
}

const TYPES: Record<string, string> = {
  step: "model/step", igs: "model/iges", stl: "model/stl", glb: "model/gltf-binary", html: "text/html", json: "application/json", csv: "text/csv",
};

async function save(name: string): Promise<void> {
  const of = done;
  if (!of) return;
  // A worker that was ended has lost the result: the same settings make it again.
  if (of.generation !== generation) {
    const again = of.kind === "fit" ? await fitAs(of.scan, of.options) : await compareAs(of.scan, of.cad, of.options);
    if (!again) return;
  }
  await watched(async () => {
    element("stage-name").textContent = `Writing ${name}`;
    const bytes = await engine.run<"save">({ do: "save", name });
    download(name, new Blob([bytes], { type: TYPES[name.split(".").pop() ?? ""] ?? "application/octet-stream" }));
    say(`${name} saved.`);
  });
}

function showTrade(result: Done): void {
  const { scene } = result;
  const { trade } = scene;
  const shown = result.kind === "fit" && trade !== null && trade.points.length > 1;
  show("trade-section", shown);
  if (!shown) return;
  const slider = element<HTMLInputElement>("trade");
  const chosen = Math.max(0, trade.points.findIndex((p) => p.control_points === trade.chosen));
  slider.max = String(trade.points.length - 1);
  slider.value = String(chosen);
  const move = (): void => {
    const k = Number(slider.value), point = trade.points[k];
    if (!point) return;
    element("trade-chart").replaceChildren(tradeChart(trade, scene.shown_in, k));
    const text = `${counted(point.control_points, "control point", "control points")}: 95 % of the points within ${lengthWords(scene.shown_in, point.p95)}, the largest distance ${lengthWords(scene.shown_in, point.max)}.`;
    element("trade-words").textContent = text;
    slider.setAttribute("aria-valuetext", text);
  };
  slider.oninput = move;
  element("trade-use").onclick = () => {
    const point = trade.points[Number(slider.value)];
    if (!point) return;
    // The share that must be within is 99.5 %, so that the tolerance is the largest distance with three digits, rounded up.
    const scale = UNITS.find(({ name }) => name === scene.unit)?.millimetres ?? 1;
    const length = point.max * scale, step = 10 ** (Math.floor(Math.log10(length)) - 1);
    const rounded = Number((Math.ceil(length / step) * step).toPrecision(2));
    element<HTMLInputElement>("tolerance").value = String(rounded);
    element<HTMLSelectElement>("tolerance-unit").value = "mm";
    element<HTMLInputElement>("tolerance").focus();
    say(`Tolerance ${rounded} mm. Make the surface again to use it.`);
  };
  move();
}

function showHistogram(scene: Scene): void {
  show("histogram-section", scene.histogram !== null);
  if (scene.histogram) element("histogram").replaceChildren(histogramChart(scene.histogram, scene.shown_in, scene.tolerance));
}

/** Worst places and findings, as lists and as marks in the view. */
function showPlaces(result: Done): void {
  const { scene, figures } = result;
  const worst = scene.worst.map((place, k): Marker => ({
    point: place.point, foot: place.foot, deviation: place.deviation, text: String(k + 1), kind: "worst",
    chosenText: `${k + 1}: ${placeWords(scene, place.deviation)}`, label: `Worst place ${k + 1}: ${placeWords(scene, place.deviation)}`,
  }));
  const found = figures.reasons.flatMap(({ what, where }): Marker[] => where ? [finding(where, sentence(what))] : []);
  const checks = result.kind === "fit" ? (result.figures.check?.checks ?? []).filter(({ pass, where }) => !pass && where) : [];
  const failed = checks.map(({ name, where }) => finding(where ?? scene.origin, `Check: ${name}`));
  markers = [...worst, ...found, ...failed];
  viewer?.setPins(markers.map((marker) => pinOf(scene, marker)));
  show("worst-section", worst.length > 0);
  element("worst").replaceChildren(...scene.worst.map((place, k) => {
    const words = placeWords(scene, place.deviation);
    return make("li", {}, button(words, () => { visit(k); }, { class: "link" }));
  }));
}

function finding(point: Marker["point"], label: string): Marker {
  return { point, text: "!", chosenText: label.length > 40 ? `${label.slice(0, 39)}…` : label, label, kind: "finding" };
}

/** A signed distance in words. */
function placeWords(of: Scene, deviation: number): string {
  return `${lengthWords(of.shown_in, Math.abs(deviation))} ${deviation < 0 ? "inside" : "outside"}`;
}

function visit(k: number): void {
  void viewer?.choose(k);
  say(markers[k]?.label ?? "");
}

function showChecks(result: Done): void {
  const check = result.kind === "fit" ? result.figures.check : undefined;
  show("checks-section", check !== undefined);
  if (!check) return;
  const failed = check.checks.filter(({ pass }) => !pass);
  element("checks-summary").textContent = failed.length === 0 && check.reads_back
    ? `${counted(check.checks.length, "check", "checks")} passed, and the file reads back the same.`
    : `${counted(failed.length, "check", "checks")} of ${check.checks.length} failed.`;
  element("checks").replaceChildren(...failed.map((one) => {
    const words = `${one.name.replaceAll("_", " ")}: ${digits(one.measured)} ${one.unit}, the limit is ${digits(one.limit)}`;
    const k = markers.findIndex(({ label }) => label === `Check: ${one.name}`);
    return make("li", {}, k < 0 ? words : button(words, () => { visit(k); }, { class: "link" }));
  }));
}

// ---- View

const MODE_WORDS: Record<Mode, string> = {
  plain: "Plain", deviation: "Deviation", zebra: "Zebra stripes", mean_curvature: "Mean curvature", gaussian_curvature: "Gaussian curvature",
};
const LAYER_WORDS: Record<Shown, string> = { surface: "Surface", points: "Points", edges: "Edges", iso: "Iso-curves", net: "Control net" };
/** Layers that are shown now; those that a scene does not have, too. */
const shown = new Set<Shown>(["surface", "points", "edges"]);
/** Scenes whose origins are nearer than this, in sizes of the part, are of the same part: the view is kept. */
const SAME_PLACE = 0.1;

let scene: Scene | null = null;

function display(next: Scene): void {
  const before = scene;
  scene = next;
  markers = [];
  const drawing = drawingOf(next);
  viewer?.show(drawing, before !== null && size(sub(before.origin, next.origin)) < SAME_PLACE * drawing.bounds.diagonal);
  viewer?.setLengths(lengthsOf(next));
  viewer?.set({ lift: liftOf(drawing, next.statistics?.scan_to_surface.p99) });
  const modes = MODES.filter((mode) => hasMode(next, mode));
  const select = element<HTMLSelectElement>("mode");
  const chosen = select.value as Mode;
  select.replaceChildren(...modes.map((mode) => make("option", { value: mode }, MODE_WORDS[mode])));
  const usual = modes.includes("deviation") ? "deviation" : "plain";
  select.value = chosen !== "plain" && modes.includes(chosen) ? chosen : usual;
  // Points over a surface with colours hide them.
  if (next.kind !== "view") shown.delete("points"); else shown.add("points");
  const layers = (Object.keys(LAYERS) as Shown[]).filter((layer) => viewer && hasLayer(next, layer));
  element("layers").replaceChildren(...layers.map((layer) => {
    const box = make("input", { type: "checkbox", "data-layer": layer });
    box.checked = shown.has(layer);
    box.addEventListener("change", () => {
      if (box.checked) shown.add(layer); else shown.delete(layer);
      showLayers();
    });
    return make("label", {}, box, ` ${LAYER_WORDS[layer]}`);
  }));
  showLayers();
  colour();
}

function showLayers(): void {
  if (!viewer) return;
  const on = (layer: Layer): boolean => (Object.keys(LAYERS) as Shown[]).some((name) => shown.has(name) && (LAYERS[name] as Layer[]).includes(layer));
  const { layers } = viewer.settings;
  for (const layer of Object.values(LAYERS).flat()) layers[layer] = on(layer);
  viewer.set({ layers });
}

function colour(): void {
  if (!scene) return;
  const mode = value("mode") as Mode;
  const scale = scaleOf(scene, mode);
  viewer?.set({ mode, scale, hatched: mode === "plain" || mode === "deviation" });
  show("legend", scale !== null && viewer !== null);
  if (!scale) return;
  const { low, high } = scale;
  const own = scene;
  const words = mode === "deviation" ? (x: number) => lengthWords(own.shown_in, x, high) : (x: number) => `${digits(x)} 1/${own.unit}${mode === "gaussian_curvature" ? "²" : ""}`;
  element("low").textContent = words(low);
  element("high").textContent = (mode === "deviation" ? "+" : "") + words(high);
  element("bar").style.background = gradient(scale);
  const note = scene.tolerance !== null ? "The scale is the tolerance." : "95 % of the points are within the scale.";
  element("legend-note").replaceChildren(
    ...(mode === "deviation" ? [`${note} Positive is outside. Beyond: `, swatch(BEYOND[scale.map].below), " below, ", swatch(BEYOND[scale.map].above), " above. Hatched: no points."] : []),
  );
}

function swatch(colour: string): HTMLElement {
  const made = make("span", { "aria-hidden": "true" });
  made.style.cssText = `display:inline-block;width:.8em;height:.8em;border-radius:2px;background:${colour}`;
  return made;
}

// ---- The page

/** Brings fields and buttons in line with the state. */
function refresh(): void {
  const any = files.length > 0;
  show("welcome", !any);
  show("files-section", any);
  show("settings", scan !== null);
  show("tools", any && viewer !== null);
  if (!any) show("legend", false);
  element("files").replaceChildren(...files.map((opened) => {
    const { look } = opened;
    const item = make("li");
    if (look.kind === "scan" && files.filter((file) => file.look.kind === "scan").length > 1) {
      const pick = make("input", { type: "radio", name: "scan" });
      pick.checked = scan === opened;
      pick.addEventListener("change", () => {
        choose(opened);
        forgetResult(look.scene);
        refresh();
      });
      item.append(make("label", {}, pick, ` ${opened.name}`));
    } else {
      item.append(make("span", {}, opened.name, look.kind === "cad" ? make("small", {}, " CAD file") : ""));
    }
    item.append(button("Remove", () => { close(opened); }, { class: "link", "aria-label": `Remove ${opened.name}` }));
    return item;
  }));
  const active = scan ?? cad;
  element("about").textContent = active ? aboutWords(active.look) : "";
  element("file-warnings").replaceChildren(...(active?.look.warnings ?? []).map((text) => make("p", { class: "note" }, sentence(text))));
  if (scan) showUnits(scan);
  show("align-field", scan !== null && cad !== null);
  show("compare", scan !== null && cad !== null);
  const ready = scan !== null && unit !== null && !working;
  element<HTMLButtonElement>("make").disabled = !ready;
  element<HTMLButtonElement>("compare").disabled = !ready;
  for (const save of element("saves").querySelectorAll("button")) save.disabled = working;
  element("make-help").textContent = scan && !unit ? "Choose the unit of the scan first: the file does not say it." : "";
}

function showUnits(of: Opened): void {
  const asked = of.look.unitSource === "assumed";
  element("units").classList.toggle("asked", asked && unit === null);
  element("unit-question").textContent = asked && unit === null
    ? "The file does not say its unit. How large is the part along its longest side?"
    : asked ? "The file does not say its unit; you chose it." : "";
  const box = of.look.boundingBox;
  element("unit-choices").replaceChildren(...UNITS.map(({ name, label }) => {
    const pick = make("input", { type: "radio", name: "unit", value: name });
    pick.checked = unit === name;
    pick.addEventListener("change", () => {
      unit = name;
      refresh();
      element("unit-choices").querySelector<HTMLInputElement>(`input[value="${name}"]`)?.focus();
    });
    const size = box ? make("small", {}, ` ${pictured(box, name)}`) : "";
    return make("label", {}, pick, ` ${label}`, size);
  }));
}

function setTheme(name: "light" | "dark"): void {
  document.documentElement.dataset.theme = name;
  const toggle = element("theme");
  toggle.setAttribute("aria-pressed", String(name === "dark"));
  toggle.textContent = "Dark";
  viewer?.set({ dark: name === "dark" });
}

element("make").addEventListener("click", () => void makeSurface());
element("compare").addEventListener("click", () => void compareFiles());
element("cancel").addEventListener("click", () => { engine.cancel(); });
element("mode").addEventListener("change", colour);
element("fit-view").addEventListener("click", () => { viewer?.look("fit"); });
element("picture").addEventListener("click", () => void viewer?.picture(getComputedStyle(element("stage")).backgroundColor).then((blob) => {
  if (blob) download(`${stem((scan ?? cad)?.name ?? "view")}.png`, blob);
}));
const picker = element<HTMLInputElement>("picker");
for (const id of ["open", "choose"]) element(id).addEventListener("click", () => { picker.click(); });
picker.addEventListener("change", () => {
  const list = [...(picker.files ?? [])];
  picker.value = "";
  void openFiles(list);
});
for (const kind of ["dragover", "drop", "dragleave"] as const) {
  document.addEventListener(kind, (event) => {
    event.preventDefault();
    element("stage").classList.toggle("over", kind === "dragover");
    if (kind === "drop" && event.dataTransfer) void openFiles([...event.dataTransfer.files]);
  });
}
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && working) engine.cancel();
});
element("theme").addEventListener("click", () => {
  const next = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  try {
    localStorage.setItem("theme", next);
  } catch {
    // A browser that keeps nothing forgets it.
  }
  setTheme(next);
});
element("examples").replaceChildren(...EXAMPLES.map((example) => make(
  "li", {}, button(make("span", {}, example.title, make("small", {}, example.about)), () => void openExample(example), { "data-example": example.shape }),
)));

let kept: string | null = null;
try {
  kept = localStorage.getItem("theme");
} catch {
  // As above.
}
setTheme(kept === "dark" || (kept === null && matchMedia("(prefers-color-scheme: dark)").matches) ? "dark" : "light");
element("version").textContent = __VERSION__;
refresh();
if (import.meta.env.PROD && "serviceWorker" in navigator) {
  // Without one the page works, but not offline.
  navigator.serviceWorker.register("./sw.js").catch(() => undefined);
}
