// What is told in words and figures.

import type { Vector } from "nurbskin-viewer";
import { finite, type Data, type Figures, type Join, type Reason, type Statistics } from "./data";
import { byId, element, within, type Child } from "./dom";
import { count, formatter, percent, type Form, type Lengths } from "./format";
import { facesTable, joinsTable, surfaceKind } from "./joins";

/** Of points, by their number. */
export const STATES = [
  "interior", "free edge", "held out of the fit", "outlier, not used", "not used: in a part without a surface",
  "duplicate, not used",
];
const stateName = (state: string): string =>
  named({ interior: STATES[0], free_edge: STATES[1] }, state) ?? state.replace(/_/g, " ");

/** Paths may break where their parts meet; what is copied stays whole. */
function breakable(text: Child): Child {
  if (text instanceof Node || !/[/\\]/.test(text)) return text;
  const parts = text.split(/(?<=[/\\_.-])/).flatMap((part, k) => (k ? [element("wbr"), part] : [part]));
  return element("span", {}, ...parts);
}

type Cell = Child | null | undefined;

/** The first cell of a row names it; `numeric` columns stand to the right. */
function table(head: string[] | null, rows: Cell[][], numeric = false): HTMLTableElement {
  const cell = (text: Cell, k: number): HTMLElement => {
    const content = text ?? "–";
    if (k === 0) return element("th", { scope: "row" }, breakable(content));
    return element("td", { class: content === "fail" ? "bad" : numeric ? "number" : null }, content);
  };
  const titles = head?.map((text, k) => element("th", { scope: "col", class: k && numeric ? "number" : null }, text));
  return element("table", { class: !head && rows.every((row) => row.length < 3) ? "pairs" : "several" },
    ...(titles ? [element("thead", {}, element("tr", {}, ...titles))] : []),
    element("tbody", {}, ...rows.map((row) => element("tr", {}, ...row.map(cell)))));
}

/** The text of a name, where it has one. */
const named = (texts: Partial<Record<string, string>>, name: string): string | undefined => texts[name];

function card(title: string, ...content: Child[]): HTMLElement {
  return element("section", { class: "card" }, element("h3", {}, title), ...content);
}

type AllStatistics = NonNullable<Data["statistics"]>;

/** The figures of all finite points, where not all of them are used. */
function others({ all_points: all, scan_to_surface: used }: AllStatistics): Figures | null {
  return all && (all.count ?? 0) > (used?.count ?? 0) ? all : null;
}

/** One column per set of distances; a row only where one of them has the figure. */
function statisticsTable(statistics: AllStatistics, lengths: Lengths, tolerance: number | null): HTMLElement {
  const sets: [string, Figures | null | undefined][] = [
    ["Scan to surface", statistics.scan_to_surface], ["All finite points", others(statistics)],
    ["Free edges", statistics.free_edges], ["Held out", statistics.hold_out], ["Surface to scan", statistics.surface_to_scan],
  ];
  const columns = sets.flatMap(([name, s]): [string, Figures][] => (s && s.count !== 0 ? [[name, s]] : []));
  const length = lengths.aligned, plus: Form = (x) => length(x, true), of = lengths.unit ? `, ${lengths.unit}` : "";
  const all: [keyof Statistics, string | null, (x: number | null | undefined) => string][] = [
    ["count", "Points", count], ["max", `Largest |d|${of}`, length], ["p99", `99 % of |d|${of}`, length],
    ["p95", `95 % of |d|${of}`, length],
    ["p50", `Median |d|${of}`, length], ["mean", `Mean |d|${of}`, length], ["rms", `RMS${of}`, length],
    ["signed_min", `Smallest d${of}`, plus], ["signed_max", `Largest d${of}`, plus],
    ["signed_mean", `Mean d${of}`, plus], ["signed_std", `Std. deviation of d${of}`, length],
    ["within_tolerance", tolerance ? `Within ±${lengths.alone(tolerance, false, 5)}` : null, percent],
    ["above_tolerance", tolerance ? "Above +tolerance" : null, count],
    ["below_tolerance", tolerance ? "Below \u2212tolerance" : null, count],
    ["unsupported_area", "Area without data", percent],
  ];
  const rows = all.filter(([key, name]) => name && columns.some(([, s]) => finite(s[key])));
  const made = table(["", ...columns.map(([name]) => name)],
    rows.map(([key, name, form]) => [name, ...columns.map(([, s]) => (finite(s[key]) ? form(s[key]) : "–"))]), true);
  const note = "d is signed, positive outside. Free edges are the points whose nearest place lies on a free border; "
    + "scan to surface counts them too.";
  const back = statistics.surface_to_scan ? " Surface to scan is taken over the area." : "";
  const more = others(statistics)
    ? " All finite points are those used and those that are not: outliers, duplicates and parts without a surface."
    : "";
  return element("div", {}, element("div", { class: "scroll" }, made), element("p", { class: "quiet" }, note + back + more));
}

/** `go.face(k)` and `go.join(join)` when a face or an edge is chosen. */
export function fillTables(into: HTMLElement, data: Data, lengths: Lengths,
  go: { face: (k: number) => void; join: (join: Join) => void }): void {
  const cards: HTMLElement[] = [], wide: HTMLElement[] = [];
  if (data.statistics) cards.push(card("Deviation", statisticsTable(data.statistics, lengths, data.tolerance)));
  for (const { title, rows } of data.tables) {
    if (rows.length) cards.push(card(title, element("div", { class: "scroll" }, table(null, rows))));
  }
  const several = data.faces.length > 1, joins = several ? joinsTable(data.joins, lengths, go.join) : null;
  if (several) wide.push(card("Faces", facesTable(data.faces, lengths, data.tolerance, go.face)));
  if (joins) wide.push(card("Angles between faces", joins));
  if (data.faces.length === 1) {
    const [face] = data.faces;
    const rows = [
      ["name", face.name], ["kind", surfaceKind(face)], ["degree", face.degree?.join(" × ")],
      ["control points", face.control_points?.join(" × ")],
    ];
    cards.push(card("Face", element("div", { class: "scroll" }, table(null, rows.filter(([, text]) => text)))));
  }
  if (data.details.length) {
    cards.push(element("details", { class: "card" },
      element("summary", {}, `What was done on the way (${count(data.details.length)})`),
      element("ol", {}, ...data.details.map((text) => element("li", {}, text)))));
  }
  byId("figures").hidden = !cards.length && !wide.length;
  // Each card goes where the least is yet; where there is one column only, the style puts them in their order again.
  const columns = [1, 2, 3].map(() => ({ tall: 0, box: element("div", { class: "column" }) }));
  cards.forEach((made, k) => {
    const least = columns.reduce((a, b) => (b.tall < a.tall ? b : a));
    made.style.order = String(k);
    least.box.append(made);
    least.tall += 3 + [...made.querySelectorAll("tr")].reduce((sum, row) => sum + Math.ceil(row.textContent.length / 45), 0);
  });
  if (data.statistics) cards[0].classList.add("whole");
  into.replaceChildren(...columns.map(({ box }) => box));
  byId("wide-tables").replaceChildren(...wide);
}

export function fillProvenance(into: HTMLElement, data: Data, lengths: Lengths): void {
  const rows: Cell[][] = [["Program", `nurbskin ${data.nurbskin ?? ""}`], ["Command", element("code", {}, data.command ?? "–")]];
  for (const input of data.inputs) {
    rows.push(["Input", element("span", {}, `${input.path}${finite(input.bytes) ? `, ${count(input.bytes)} bytes` : ""}`)]);
    if (input.sha256) rows.push(["SHA-256", element("code", {}, input.sha256)]);
  }
  rows.push(["Unit", data.unit || "not known"]);
  const box = data.bounding_box;
  if (box) {
    const form = formatter(data.bounds.diagonal, 6), size = lengths.size(box[0].map((x, k) => box[1][k] - x));
    const [from, to] = box.map((corner) => corner.map((x) => form(x)).join(", "));
    rows.push(["Bounding box", element("span", {}, `${size}, from (${from}) to (${to}) ${data.unit}`)]);
  }
  into.replaceChildren(element("div", { class: "scroll" }, table(null, rows)));
}

/** A verdict is on what was scanned: from this share on, the area that was not is pointed out. */
const MUCH_BARE = 0.05;

/** Why the verdict is what it is, each with its place, if it has one, and what to do; `go(place)` when one is chosen. */
function reasonsList(reasons: Reason[], go: (place: Vector) => void): HTMLElement[] {
  return reasons.map(({ what, where, next }, k) => {
    const line = element("li", {}, element("span", {}, what));
    if (where) {
      const attributes = { type: "button", onclick: () => { go(where); }, "aria-label": `Show the place: ${what}` };
      line.append(" ", element("button", attributes, "show"));
    }
    // The same advice for several is given once, after the last of them.
    if (next && next !== reasons[k + 1]?.next) line.append(element("span", { class: "next" }, `Next: ${next}.`));
    return line;
  });
}

const KINDS = { fit: "Deviation report of a fit", deviation: "Deviation report", view: "View" };
const SIGNS = { pass: "\u2713", fail: "\u2715", none: "–", not_asked: "–" };
const VERDICTS = { pass: "Pass", fail: "Fail", cannot_tell: "Cannot tell", none: "No verdict", not_asked: "Not asked" };

export function fillHead(data: Data, lengths: Lengths, go: (place: Vector) => void): void {
  byId("kind").textContent = named(KINDS, data.kind) ?? "Report";
  byId("title").textContent = data.title || "untitled";
  if (data.verdict || data.kind !== "view") {
    const { verdict, reason, reasons = [] } = data.verdict ?? { verdict: "none", reason: "No tolerance was given." };
    const box = byId("verdict");
    box.className = verdict;
    box.hidden = false;
    within(box, ".mark").textContent = named(SIGNS, verdict) ?? "?";
    within(box, "strong").textContent = named(VERDICTS, verdict) ?? verdict;
    within(box, ".reason").textContent = reasons.length ? "" : reason ?? "";
    within(box, ".reasons").replaceChildren(...reasonsList(reasons, go));
  }
  const fields = data.fields.map(({ key, text }) => element("div", {},
    element("dt", {}, key.charAt(0).toUpperCase() + key.slice(1)), element("dd", {}, text)));
  byId("fields").hidden = !fields.length;
  byId("fields").replaceChildren(...fields);
  const s = data.statistics?.scan_to_surface, figures: [name: string, value: string, mind?: boolean][] = [];
  const length = (x: number | null | undefined, plus = false): string => lengths.alone(x ?? NaN, plus);
  if (data.tolerance) figures.push(["Tolerance", `±${lengths.alone(data.tolerance, false, 5)}`]);
  if (s) {
    const asked = finite(data.within) ? `, asked ${percent(data.within)}` : "";
    if (data.tolerance) figures.push(["Within it", percent(s.within_tolerance) + asked]);
    figures.push(["95 % of |d|", length(s.p95)], ["Largest |d|", length(s.max)], ["RMS", length(s.rms)],
      ["Mean d", length(s.signed_mean, true)], ["Std. deviation", length(s.signed_std)]);
    if (finite(s.above_tolerance)) figures.push(["Above / below", `${count(s.above_tolerance)} / ${count(s.below_tolerance)}`]);
    figures.push(["Points", count(s.count)]);
    const all = data.statistics && others(data.statistics);
    const within = all && data.tolerance ? `, ${percent(all.within_tolerance)} within` : "";
    if (all) figures.push(["All finite points", count(all.count) + within]);
    const bare = data.statistics?.surface_to_scan?.unsupported_area;
    if (finite(bare)) figures.push(["Area without data", percent(bare), bare > MUCH_BARE]);
  } else {
    if (data.points) figures.push(["Points", count(data.points.total)]);
    if (data.faces.length) figures.push(["Faces", count(data.faces.length)]);
    if (data.mesh) figures.push([data.faces.length ? "Triangles shown" : "Triangles", count(data.mesh.triangles.length / 3)]);
    const { low, high, outline } = data.bounds;
    if (outline.length) figures.push(["Size", lengths.size(low.map((x, k) => high[k] - x))]);
  }
  figures.push(["Unit", data.unit || "not known"]);
  byId("key-figures").replaceChildren(...figures.map(([name, value, mind]) => element("div", { class: mind ? "mind" : null },
    element("dt", {}, name), element("dd", {}, value))));
}

/** The worst places; `go(k)` when one is chosen. */
export function fillWorst(into: HTMLElement, data: Data, lengths: Lengths, go: (k: number) => void): void {
  const place = formatter(data.bounds.diagonal, 6), many = data.faces.length > 1;
  const rows = data.worst.map((w, k) => {
    const label = `Show worst place ${k + 1}: ${lengths.alone(w.deviation, true)}`;
    const button = element("button", { type: "button", onclick: () => { go(k); }, "aria-label": label }, `${k + 1}`);
    const where = element("span", {}, w.point.map((x) => place(x)).join(", "), element("br"), element("span", { class: "quiet" },
      `point ${count(w.index)}, ${stateName(w.state)}${many ? `, ${data.faces[w.face].name || `face ${w.face}`}` : ""}`));
    return [button, element("b", { class: "number" }, lengths.aligned(w.deviation, true)), where];
  });
  const of = (name: string, unit: string): string => (unit ? `${name}, ${unit}` : name);
  const made = table(["", of("d", lengths.unit), of("x, y, z", data.unit)], rows);
  made.querySelectorAll("tbody tr").forEach((row, k) => {
    row.addEventListener("click", (event) => { if (!(event.target as Element).closest("button")) go(k); });
  });
  into.replaceChildren(made);
}
