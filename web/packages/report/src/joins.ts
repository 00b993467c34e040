// The faces and how they join: deviation by face, and the angles between normals at edges.

import { JUMPS, jumpClass, jumpOf } from "nurbskin-viewer";
import type { Face, Figures, Join } from "./data";
import { element, type Child } from "./dom";
import { count, exact, percent, type Lengths } from "./format";
import type { Swatch } from "./legend";

/** A column: its name, the value of a row, which sorts it, the text of the value, the class of its cells. */
type Column<Row> = [name: string, value: (row: Row) => number | string, text: (row: Row) => Child, kind: string | null];

/** A table that its columns sort. */
function sortable<Row>(rows: Row[], columns: Column<Row>[], first: number): HTMLTableElement {
  let by = first, down = true;
  const made = element("table", { class: "several sorted" }), body = element("tbody"), heads = columns.map(([name, , , kind], k) => element("th", { scope: "col", class: kind },
    element("button", { type: "button", onclick: () => { down = by === k ? !down : true; by = k; fill(); } }, name)));
  function fill(): void {
    const value = columns[by][1], size = (row: Row): number | string => { const x = value(row); return typeof x === "number" && !Number.isFinite(x) ? -Infinity : x; };
    const order = [...rows].sort((a, b) => { const [x, y] = [size(a), size(b)]; return (x < y ? -1 : x > y ? 1 : 0) * (down ? -1 : 1); });
    heads.forEach((head, k) => { if (k === by) head.setAttribute("aria-sort", down ? "descending" : "ascending"); else head.removeAttribute("aria-sort"); });
    body.replaceChildren(...order.map((row) => element("tr", {}, ...columns.map(([, , text, kind], k) => element(k ? "td" : "th", { class: kind, scope: k ? null : "row" }, text(row))))));
  }
  made.append(element("thead", {}, element("tr", {}, ...heads)), body);
  fill();
  return made;
}

/** A box that scrolls where a table is long; on paper its first rows are printed. */
const long = (made: Child): HTMLElement => element("div", { class: "scroll long" }, made);

export const surfaceKind = (face: Face): string => face.kind.replace("b_spline", "B-spline").replace(/_/g, " ");

interface Row {
  face: Face;
  k: number;
  s: Figures | null;
}

/** Every face with its surface, and its deviation where there is one; `go(k)` when a face is chosen. */
export function facesTable(faces: Face[], lengths: Lengths, tolerance: number | null, go: (k: number) => void): HTMLElement {
  const rows = faces.map((face, k) => ({ face, k, s: face.deviation })), measured = faces.some((f) => f.deviation);
  const name = ({ face, k }: Row): Child => element("button", { type: "button", class: "plain", onclick: () => { go(k); } }, face.name || `face ${k}`);
  const of = lengths.unit ? `, ${lengths.unit}` : "", figure = (key: keyof Figures, text: (x: number | null | undefined) => string): [Column<Row>[1], Column<Row>[2]] =>
    [(row) => row.s?.[key] ?? NaN, (row) => (row.s?.count ? text(row.s[key]) : "–")];
  const plus = (x: number | null | undefined): string => lengths.aligned(x, true);
  const columns: Column<Row>[] = [["Face", (row) => -row.k, name, null]];
  if (measured) {
    columns.push(["Points", ...figure("count", count), "number rare"], [`Mean d${of}`, ...figure("signed_mean", plus), "number"], [`Std. dev.${of}`, ...figure("signed_std", lengths.aligned), "number rare"],
      [`95 % of |d|${of}`, ...figure("p95", lengths.aligned), "number"], [`Largest |d|${of}`, ...figure("max", lengths.aligned), "number"]);
    if (tolerance) columns.push(["Within", ...figure("within_tolerance", percent), "number"], ["Above", ...figure("above_tolerance", count), "number rare"], ["Below", ...figure("below_tolerance", count), "number rare"]);
  }
  columns.push(["Kind", (row) => surfaceKind(row.face), (row) => surfaceKind(row.face), "rare"], ["Degree", (row) => row.face.degree?.[0] ?? 0, (row) => row.face.degree?.join(" × ") ?? "–", "number rare"],
    ["Control points", (row) => (row.face.control_points ?? [0, 0]).reduce((a, b) => a * b), (row) => row.face.control_points?.join(" × ") ?? "–", "number rare"]);
  const made = sortable(rows, columns, measured ? columns.findIndex(([head]) => head.startsWith("Largest")) : 0);
  const note = measured ? element("p", { class: "quiet" }, "By the face of the nearest place of each point. The colour \u201Cmean deviation of faces\u201D shows them.") : "";
  return element("div", {}, long(made), note, element("p", { class: "quiet paper" }, faces.length > 12 ? `The first 12 of ${count(faces.length)} faces are printed.` : ""));
}

/** The edges that are meant to be smooth, by the angle between the normals of their faces; `go(join)` when one is chosen. */
export function joinsTable(joins: Join[], lengths: Lengths, go: (join: Join) => void): HTMLElement | null {
  const smooth = joins.filter((join) => join.kind === "smooth" && Number.isFinite(jumpOf(join)));
  if (!smooth.length) return null;
  const angle = (x: number | null): string => (Number.isFinite(x) ? exact(x ?? NaN, 2) : "–");
  const columns: Column<Join>[] = [["Edge", (j) => -j.edge, (j) => element("button", { type: "button", class: "plain", onclick: () => { go(j); } }, `edge ${j.edge}`), null],
    ["Faces", (j) => j.faces.join(" "), (j) => j.faces.join(", "), null], ["At most, °", jumpOf, (j) => angle(j.bound), "number"], ["Sampled, °", (j) => j.sampled ?? NaN, (j) => angle(j.sampled), "number"],
    ["Length", (j) => j.length ?? NaN, (j) => lengths.alone(j.length ?? NaN), "number rare"]];
  const sharp = joins.filter((join) => join.kind === "sharp").length, open = joins.filter((join) => join.kind === "open").length;
  const words = `${count(smooth.length)} smooth edges${sharp ? `, ${count(sharp)} sharp` : ""}${open ? `, ${count(open)} at borders` : ""}. \u201CAt most\u201D holds on the whole edge, between the samples too.`;
  return element("div", {}, long(sortable(smooth, columns, 2)), element("p", { class: "quiet" }, words),
    element("p", { class: "quiet paper" }, smooth.length > 12 ? "The first 12 edges are printed." : ""));
}

/** What the colours of edges mean, with how many there are of each. */
export function jumpSwatches(joins: Join[]): Swatch[] {
  const smooth = joins.filter((join) => join.kind === "smooth" && Number.isFinite(jumpOf(join)));
  const found = JUMPS.map(([limit, colour], k): Swatch => {
    const n = smooth.filter((join) => jumpClass(join) === k).length, text = limit === Infinity ? `over ${JUMPS[k - 1][0]}°` : `to ${limit}°`;
    return [colour, `${text}: ${count(n)}`];
  });
  const sharp = joins.filter((join) => join.kind === "sharp").length;
  if (sharp) found.push(["feature", `sharp: ${count(sharp)}`]);
  const open = joins.filter((join) => join.kind === "open").length;
  if (open) found.push(["border", `border: ${count(open)}`]);
  return found;
}
