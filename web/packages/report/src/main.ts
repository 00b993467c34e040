// The page: reads the data, fills what is words, starts the view where there can be one, and ties the controls to it.

import { DUPLICATE, UNUSED, jumpOf, sub, type Layer, type MapName, type Vector } from "nurbskin-viewer";
import { cropped, drawHistogram } from "./charts";
import { finite, magnitude, readData, type Data } from "./data";
import { byId, element, within } from "./dom";
import { count, formatter, lengthsLike, type Form, type Lengths } from "./format";
import { jumpSwatches } from "./joins";
import { drawLegend, type Swatch, type Titled } from "./legend";
import { Marks } from "./marks";
import { print, unfold } from "./paper";
import { csvOf, fileName, pageWith, save, savePicture } from "./save";
import { Section, type SectionState } from "./section";
import { STATES, fillHead, fillProvenance, fillTables, fillWorst } from "./tables";
import { drawTrade } from "./trade";
import { View, anyUnused, byFace, middleOf } from "./view";

type There = (data: Data) => unknown;

/** Name, text, whether there is any, whether it is on at first. Points lie on the surface, unless they are far off it. */
const LAYERS: [name: Layer, text: string, there: There, on?: boolean | ((data: Data) => boolean)][] = [
  ["surface", "Surface", (d) => d.mesh, true],
  ["points", "Points", (d) => d.points, (d) => !d.mesh || d.bounds.diagonal > 2 * d.bounds.size],
  ["rejected", "Points not used", anyUnused, true],
  ["net", "Control net", (d) => d.lines.control_net],
  ["iso", "Iso-curves", (d) => d.lines.iso_curves],
  ["edges", "Edges", (d) => d.lines.edges && d.joins.some((join) => join.kind !== "sharp"), true],
  ["features", "Feature lines", (d) => d.lines.edges && d.joins.some((join) => join.kind === "sharp"), true],
  ["seams", "Seams and poles", (d) => d.lines.seams ?? d.poles.length, true],
  ["unsupported", "Area without data", (d) => d.mesh?.deviation?.some(Number.isNaN), true],
  ["worst", "Worst places", (d) => d.worst.length, true],
];
type Mode = "deviation" | "height" | "plain" | "mean" | "gaussian" | "zebra" | "jumps" | "faces" | "by_face";
const MODES: [name: Mode, text: string, there: There][] = [
  ["deviation", "deviation", (d) => d.mesh?.deviation ?? d.points?.deviation],
  ["height", "height", (d) => d.points && !d.mesh],
  ["plain", "plain", () => true],
  ["mean", "mean curvature", (d) => d.mesh?.mean],
  ["gaussian", "Gaussian curvature", (d) => d.mesh?.gaussian],
  ["zebra", "zebra stripes", (d) => d.mesh],
  ["jumps", "angles between faces", (d) => d.mesh && d.lines.edges
    && d.joins.some((join) => join.kind === "smooth" && Number.isFinite(jumpOf(join)))],
  ["faces", "faces", (d) => d.mesh?.faces && d.faces.length > 1],
  ["by_face", "mean deviation of faces", byFace],
];
/** Modes that hatch the area without data. */
const HATCHED: Mode[] = ["deviation", "plain", "by_face"];

const NOTES: Partial<Record<Mode, string>> = {
  plain: "No colour scale.",
  zebra: "Reflected stripes: where they break, the tangent does; where they kink, the curvature does.",
  faces: "One colour for each face.",
  jumps: "How far the normals of two faces turn at their common edge, at most; the numbers are those of the edges.",
};

/** Limits of the scales, by the mode; `tolerance` is that of the deviation with the map of the tolerance. */
type Limits = Partial<Record<Mode | "tolerance", number>>;

interface Settings {
  mode: Mode;
  map: MapName;
  stripes: number;
  pointSize: number;
  lift: number;
  layers: Record<Layer, boolean>;
  scale: Titled | null;
  section?: SectionState;
}

/** The limits of the scales that a mode has: P95 of what it shows. */
function firstLimits(data: Data): Limits {
  const { mesh, points, bounds, statistics, faces, tolerance } = data, limits: Limits = {};
  const deviations = mesh?.deviation ?? points?.deviation, s = statistics?.scan_to_surface;
  if (deviations) limits.deviation = Math.max(s?.p95 || magnitude(deviations, 0.95) || (tolerance ?? 0), 1e-9 * bounds.size);
  // Rounded up, so that the noise of a constant curvature is not off the scale; no less than what is flat.
  const rounded = (values: ArrayLike<number>, flat: number, share = 0.95): number => {
    const x = Math.max(1.02 * magnitude(values, share), flat), step = 10 ** (Math.floor(Math.log10(x)) - 1);
    return Number((Math.ceil(x / step) * step).toPrecision(2));
  };
  const means = faces.map(({ deviation }) => (deviation?.count ? deviation.signed_mean : null)).filter(finite);
  if (means.length) limits.by_face = rounded(means, 1e-9 * bounds.size, 1);
  // The map of the tolerance reaches beyond it, as far as points do, but no farther than shows the tolerance.
  if (tolerance && deviations) limits.tolerance = Math.max(1.5 * tolerance,
    Math.min(s?.max ?? 0, Math.max(4 * tolerance, s?.p95 ?? 0)));
  if (mesh?.mean) limits.mean = rounded(mesh.mean, 1e-3 / bounds.size);
  if (mesh?.gaussian) limits.gaussian = rounded(mesh.gaussian, 1e-6 / bounds.size ** 2);
  return limits;
}

/** Which of the limits holds: that of the mode, or that of the map of the tolerance. */
function limitName({ mode, map }: Pick<Settings, "mode" | "map">): Mode | "tolerance" {
  return mode === "deviation" && map === "tolerance" ? "tolerance" : mode;
}

function scaleOf(data: Data, settings: Pick<Settings, "mode" | "map">, limits: Limits, lengths: Lengths): Titled | null {
  const { mode, map } = settings, limit = limits[limitName(settings)], per = data.unit ? `1/${data.unit}` : "";
  if (mode === "height") {
    const { low, high, diagonal } = data.bounds, form = formatter(diagonal, 4), offset = data.origin[2];
    const format: Form = (x) => form((x ?? NaN) + offset);
    return { map: "height", low: low[2], high: high[2], title: "Height z", unit: data.unit, offset, format };
  }
  if (!limit) return null;
  const plain = map === "tolerance" ? "diverging" : map, common = { map: plain, low: -limit, high: limit, symmetric: true };
  const { unit, factor, aligned: format, alone } = lengths;
  const long = { unit, factor, note: "+ outside, \u2212 inside", format, alone };
  if (mode === "by_face") return { ...common, ...long, title: "Mean deviation of faces" };
  if (mode === "deviation") {
    const scale: Titled = { ...common, ...long, title: "Deviation", tolerance: data.tolerance };
    if (map !== "tolerance" || !data.tolerance) return scale;
    const high = Math.max(limit, data.tolerance);
    return { ...scale, map, low: -high, high, band: data.tolerance };
  }
  const mean = mode === "mean";
  const title = mean ? "Mean curvature" : "Gaussian curvature";
  return { ...common, title, unit: mean ? per : per && `${per}²`, format: formatter(limit, 2) };
}

function swatches({ mesh, joins }: Data, { layers, mode }: Settings, points: Set<number>): Swatch[] {
  const found = mode === "jumps" ? jumpSwatches(joins) : [];
  const bare = layers.surface && layers.unsupported && mesh?.deviation?.some(Number.isNaN);
  if (bare && HATCHED.includes(mode)) found.push(["hatched", "no data under it"]);
  if (layers.points && points.size > 1) {
    for (const k of points) if (k < UNUSED || layers.rejected) found.push([`state-${k}`, k ? STATES[k] : "point"]);
  }
  return found;
}

const onAtFirst = (data: Data, on: boolean | ((data: Data) => boolean) = false): boolean =>
  (typeof on === "function" ? on(data) : on);

const narrow = matchMedia("screen and (max-width: 640px)"), darkness = matchMedia("(prefers-color-scheme: dark)");

async function start(): Promise<Record<string, unknown>> {
  // Before anything changes, for a copy of the page.
  const loaded = document.documentElement.outerHTML;
  const data = await readData(byId("data").textContent);
  const { size } = data.bounds, used = data.statistics?.scan_to_surface, reference = used?.p95 || data.tolerance || 1e-3 * size;
  const lengths = lengthsLike(data.shown_in, reference), limits = firstLimits(data), first = { ...limits };
  const states = new Set(data.points ? Array.from(data.points.state).filter((k) => k < DUPLICATE).sort() : []);
  const ownModes = MODES.filter(([, , there]) => there(data)), ownLayers = LAYERS.filter(([, , there]) => there(data));
  const modes = ownModes.map(([name]) => name), layers = ownLayers.map(([name]) => name);
  const shownFirst = LAYERS.map(([name, , there, on]) => [name, !!there(data) && onAtFirst(data, on)]);
  const settings: Settings = {
    mode: modes[0], map: data.tolerance && modes[0] === "deviation" ? "tolerance" : "diverging", stripes: 20, pointSize: 0,
    lift: Math.min(Math.max(0.0015 * size, 1.2 * (used?.p99 ?? 0)), 0.02 * size), scale: null,
    layers: Object.fromEntries(shownFirst) as Record<Layer, boolean>,
  };
  // Nothing is cut away where nothing says what lies under it.
  if (!layers.includes("unsupported")) settings.layers.unsupported = true;

  let view: View | null = null;
  const said = (text: string): void => { byId("said").textContent = byId("tool-help").textContent = text; };
  const marks = new Marks(data, lengths, { moved: () => { view?.viewer.setMarks(marks.shown()); }, said });
  const section = data.mesh ? new Section(data, data.mesh, lengths) : null;
  if (section) settings.section = section.state;
  byId("section").hidden = !section;
  byId("save-csv").hidden = !data.points?.deviation;
  byId("save-csv").addEventListener("click", () => { save(fileName(data.title, ".csv"), csvOf(data), "text/csv"); });
  byId("save-page").addEventListener("click",
    () => { save(fileName(data.title, ".html"), pageWith(loaded, marks.items), "text/html"); });
  byId("save-picture").addEventListener("click", () => { if (view) void savePicture(view.viewer, data); });
  fillHead(data, lengths, (place) => { view?.visit(place); });
  fillTables(byId("tables"), data, lengths, {
    join: ({ place }) => { if (place) view?.visit(place); },
    face: (k) => { view?.visit(middleOf(data, k)); },
  });
  fillProvenance(byId("provenance"), data, lengths);
  if (data.worst.length) {
    byId("worst").hidden = false;
    fillWorst(within(byId("worst"), ".scroll"), data, lengths, (k) => { void view?.choose(k); });
  }
  if (!data.histogram && !data.worst.length) {
    document.body.classList.add("wide");
    byId("no-deviation").hidden = false;
    byId("no-deviation").textContent = data.kind === "view"
      ? "No deviation here: this page shows what is in the file. "
        + "nurbskin deviation SCAN CAD --report FILE.html compares a scan with a surface."
      : "No deviation here: nothing was measured.";
  }

  function histogram(): void {
    if (!data.histogram?.counts.length) return;
    byId("histogram").hidden = false;
    const scale = scaleOf(data, { ...settings, mode: "deviation" }, { deviation: reference, ...limits }, lengths);
    const common = 1.5 * (used?.p95 ?? Infinity), few = common < 0.5 * data.histogram.high;
    byId("crop-tool").hidden = !few;
    const shown = few && byId<HTMLInputElement>("crop").checked ? cropped(data.histogram, common) : data.histogram;
    const logarithmic = byId<HTMLInputElement>("log").checked, { tolerance } = data;
    if (scale) drawHistogram(within(byId("histogram"), ".chart"), shown, { scale, lengths, tolerance, logarithmic });
  }
  for (const id of ["log", "crop"]) byId(id).addEventListener("change", histogram);
  function trade(): void {
    if (!data.trade?.points.length) return;
    byId("trade").hidden = false;
    drawTrade(within(byId("trade"), ".chart"), data.trade, lengths);
  }
  new ResizeObserver(() => { histogram(); trade(); }).observe(byId("side"));

  /** Shows what the settings are, in the controls and in the view. */
  function update(): void {
    const scale = settings.scale = scaleOf(data, settings, limits, lengths), { mode, map, stripes, pointSize, lift } = settings;
    const limit = limits[limitName(settings)] ?? NaN;
    if (section) {
      section.scale = scaleOf(data, { ...settings, mode: "deviation" }, limits, lengths);
      section.ask();
    }
    byId<HTMLSelectElement>("mode").value = mode;
    byId<HTMLSelectElement>("map").value = scale?.symmetric ? scale.map : map;
    byId("scale-tools").hidden = !scale?.symmetric;
    byId("stripes-tool").hidden = mode !== "zebra";
    byId("size-tool").hidden = !settings.layers.points;
    if (scale?.symmetric) {
      const field = byId<HTMLInputElement>("limit"), row = byId("presets");
      field.value = String(Number(((scale.factor ?? 1) * limit).toPrecision(4)));
      field.removeAttribute("aria-invalid");
      byId("limit-unit").textContent = scale.unit;
      const focused = [...row.children].findIndex((button) => button === document.activeElement);
      row.replaceChildren(...presets().map(([name, value]) => element("button", {
        type: "button", "aria-pressed": String(Math.abs(value / limit - 1) < 1e-6), onclick: () => { setLimit(value); },
      }, name)));
      if (focused >= 0) (row.children.item(focused) as HTMLElement | null)?.focus();
    }
    const buttons = [...byId("layers").querySelectorAll<HTMLElement>("[data-layer]")];
    for (const button of buttons) {
      if (button.dataset.layer === "rejected") button.hidden = !settings.layers.points;
      button.setAttribute("aria-pressed", String(settings.layers[button.dataset.layer as Layer]));
    }
    byId("canvas").setAttribute("aria-label", `${data.title}, ${MODES.find(([name]) => name === mode)?.[1] ?? ""}`);
    histogram();
    legend();
    const hatched = HATCHED.includes(mode), dark = darkness.matches;
    view?.viewer.set({ mode, scale, stripes, pointSize, lift, layers: { ...settings.layers }, hatched, dark });
  }
  function legend(): void {
    const scale = settings.layers.surface || settings.layers.points ? settings.scale : null;
    const inside = settings.mode === "plain" && data.mesh?.normals ? " The inside of the surface is bluish." : "";
    const note = (NOTES[settings.mode] ?? "") + inside;
    drawLegend(byId("legend"), { scale, note, swatches: swatches(data, settings, states), lying: narrow.matches });
  }
  function presets(): [string, number][] {
    const exactly = settings.mode !== "deviation" || used?.p95 === first.deviation;
    const name = limitName(settings), usual = exactly && name === "deviation" ? "P95" : "default";
    const found: [string, number][] = [[usual, first[name] ?? NaN]];
    if (settings.mode !== "deviation") return found;
    if (data.tolerance) found.push(["tolerance", data.tolerance]);
    if (used?.max) found.push(["largest", used.max]);
    return found;
  }
  function setLimit(value: number): void {
    if (value > 0 && Number.isFinite(value)) {
      // With the map of the tolerance, what is within it stays green.
      const name = limitName(settings);
      limits[name] = name === "tolerance" ? Math.max(value, data.tolerance ?? 0) : value;
      update();
    } else byId("limit").setAttribute("aria-invalid", "true");
  }
  const set = (some: Partial<Settings>): void => { Object.assign(settings, some); update(); };
  const setLayer = (name: Layer, on: boolean): void => { settings.layers[name] = on; update(); };
  const onValue = (id: string, event: string, what: (value: string) => void): void => {
    const field = byId<HTMLInputElement>(id);
    field.addEventListener(event, () => { what(field.value); });
  };

  if (data.tolerance) Object.assign(byId<HTMLSelectElement>("map").options[0], { hidden: false, disabled: false });
  byId("mode").append(...ownModes.map(([name, text]) => element("option", { value: name }, text)));
  onValue("mode", "change", (value) => { set({ mode: value as Mode }); });
  onValue("map", "change", (value) => { set({ map: value as MapName }); });
  onValue("stripes", "input", (value) => { set({ stripes: Number(value) }); });
  onValue("point-size", "input", (value) => { set({ pointSize: Number(value) }); });
  onValue("limit", "change", (value) => {
    setLimit(Number(value.trim().replace(",", ".").replace("\u2212", "-")) / (settings.scale?.factor ?? 1));
  });
  byId("layers").append(...ownLayers.map(([name, text]) => element("button", {
    type: "button", "data-layer": name, onclick: () => { setLayer(name, !settings.layers[name]); },
  }, text)));
  const absent = LAYERS.filter(([name]) => !layers.includes(name) && !["rejected", "unsupported", "worst"].includes(name))
    .map(([, text]) => text.toLowerCase());
  byId("absent").textContent = absent.length ? `Not in this file: ${absent.join(", ")}.` : "";
  for (const button of document.querySelectorAll<HTMLElement>("[data-view]")) {
    button.addEventListener("click", () => { view?.viewer.look(button.dataset.view as "fit"); });
  }
  byId("perspective").addEventListener("click", () => { view?.viewer.project(!view.viewer.camera.perspective); });
  if (data.points && data.points.count < data.points.total) {
    byId("thinned").textContent = `${count(data.points.count)} of ${count(data.points.total)} points are drawn`
      + (data.statistics ? "; statistics and histogram are over all of them." : ".");
  }
  within(document, "label:has(#log)").hidden = !data.histogram;

  addEventListener("beforeprint", () => {
    addEventListener("afterprint", unfold(), { once: true });
  });

  update();
  trade();
  try {
    const any = data.mesh ?? data.points ?? Object.values(data.lines).some(Boolean);
    if (!any) throw new Error("There is nothing to draw in this page.");
    view = new View(data, lengths, marks, section, () => settings.scale, (k) => {
      byId("worst").querySelectorAll("tbody tr").forEach((row, i) => {
        if (i === k) row.setAttribute("aria-current", "true");
        else row.removeAttribute("aria-current");
      });
    });
    narrow.addEventListener("change", update);
    darkness.addEventListener("change", update);
    const { viewer } = view;
    addEventListener("beforeprint", () => { print(viewer); marks.print(); });
    viewer.setMarks(marks.shown());
    update();
    viewer.draw();
  } catch (error) {
    const { message } = error as Error;
    document.body.classList.add("flat");
    byId("no-view").hidden = false;
    byId("no-view").textContent = message === "no WebGL 2"
      ? "The 3-D view needs WebGL 2, which this browser or its graphics driver does not offer. All figures are below."
      : message;
  }

  const viewer = view?.viewer ?? null;
  return {
    modes, layers, settings, data, drawn: !!viewer, setLayer, setLimit, marks, section,
    setMode: (mode: Mode) => { set({ mode }); }, setMap: (map: MapName) => { set({ map }); },
    camera: () => viewer && { ...viewer.camera.pose, rotation: viewer.camera.rotation.toArray() },
    look: (name: "fit") => { viewer?.look(name); }, worst: (k: number) => view?.choose(k),
    visit: (place: Vector) => { view?.visit(place); },
    pick: (x: number, y: number) => view?.pick(x, y), frames: () => viewer?.frames, resting: () => !viewer || viewer.resting,
    locate: (place: Vector) => viewer?.locate(sub(place, data.origin)) ?? [NaN, NaN],
    csv: () => csvOf(data), copy: () => pageWith(loaded, marks.items),
  };
}

// For tests and for scripts in the console; positions are in the file's unit. The page calls `start`, and keeps `ready`.
declare global {
  interface Window {
    nurbskin: Record<string, unknown>;
  }
}
window.nurbskin.start = async (): Promise<true> => {
  Object.assign(window.nurbskin, await start());
  return new Promise((done) => { requestAnimationFrame(() => { done(true); }); });
};
