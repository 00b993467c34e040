// The faces and how they join: deviation by face, and the angles between normals at edges.

import { JUMPS, jumpClass, jumpOf } from "nurbskin-viewer";
import type { Face, Figures, Join } from "./data";
import { element, type Child } from "./dom";
import { count, exact, percent, type Form, type Lengths } from "./format";
import type { Swatch } from "./legend";

/** A column: its name, the value of a row, which sorts it, the text of the value, the class of its cells. */
type Column<Row> = [name: string, value: (row: Row) => number | string, text: (row: Row) => Child, kind: string | null];

/** A table that its columns sort. */
function sortable<Row>(rows: Row[], columns: Column<Row>[], first: number): HTMLTableElement {
  let by = first, down = true;
  const made = element("table", { class: "several sorted" }), body = element("tbody");
  const sort = (k: number): void => {
    down = by === k ? !down : true;
    by = k;
    fill();
  };
  const heads = columns.map(([name, , , kind], k) => element("th", { scope: "col", class: kind },
    element("button", { type: "button", onclick: () => { sort(k); } }, name)));
  function fill(): void {
    const value = columns[by][1];
    const size = (row: Row): number | string => {
      const x = value(row);
      return typeof x === "number" && !Number.isFinite(x) ? -Infinity : x;
    };
    const order = [...rows].sort((a, b) => {
      const [x, y] = [size(a), size(b)];
      return (x < y ? -1 : x > y ? 1 : 0) * (down ? -1 : 1);
    });
    heads.forEach((head, k) => {
      if (k === by) head.setAttribute("aria-sort", down ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
    const cell = (row: Row, [, , text, kind]: Column<Row>, k: number): HTMLElement =>
      element(k ? "td" : "th", { class: kind, scope: k ? null : "row" }, text(row));
    body.replaceChildren(...order.map((row) => element("tr", {}, ...columns.map((column, k) => cell(row, column, k)))));
  }
  made.append(element("thead", {}, element("tr", {}, ...heads)), body);
  fill();
  return made;
}

/** Rows of a long table on paper; the style hides the others. */
const PRINTED = 12;

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
  const name = ({ face, k }: Row): Child => element("button", { type: "button", class: "plain", onclick: () => { go(k); } },
    face.name || `face ${k}`);
  const of = lengths.unit ? `, ${lengths.unit}` : "", plus: Form = (x) => lengths.aligned(x, true);
  const figure = (key: keyof Figures, text: (x: number | null | undefined) => string): [Column<Row>[1], Column<Row>[2]] =>
    [(row) => row.s?.[key] ?? NaN, (row) => (row.s?.count ? text(row.s[key]) : "–")];
  const columns: Column<Row>[] = [["Face", (row) => -row.k, name, null]];
  if (measured) {
    columns.push(
      ["Points", ...figure("count", count), "number rare"], [`Mean d${of}`, ...figure("signed_mean", plus), "number"],
      [`Std. dev.${of}`, ...figure("signed_std", lengths.aligned), "number rare"],
      [`95 % of |d|${of}`, ...figure("p95", lengths.aligned), "number"],
      [`Largest |d|${of}`, ...figure("max", lengths.aligned), "number"],
    );
    if (tolerance) columns.push(
      ["Within", ...figure("within_tolerance", percent), "number"],
      ["Above", ...figure("above_tolerance", count), "number rare"],
      ["Below", ...figure("below_tolerance", count), "number rare"],
    );
  }
  const controls = ({ face }: Row): number => (face.control_points ?? [0, 0]).reduce((a, b) => a * b);
  columns.push(
    ["Kind", (row) => surfaceKind(row.face), (row) => surfaceKind(row.face), "rare"],
    ["Degree", (row) => row.face.degree?.[0] ?? 0, (row) => row.face.degree?.join(" × ") ?? "–", "number rare"],
    ["Control points", controls, (row) => row.face.control_points?.join(" × ") ?? "–", "number rare"],
  );
  const made = sortable(rows, columns, measured ? columns.findIndex(([head]) => head.startsWith("Largest")) : 0);
  const words = "By the face of the nearest place of each point. The colour \u201Cmean deviation of faces\u201D shows them.";
  const printed = faces.length > PRINTED ? `The first ${PRINTED} of ${count(faces.length)} faces are printed.` : "";
  return element("div", {}, long(made), measured ? element("p", { class: "quiet" }, words) : "",
    element("p", { class: "quiet paper" }, printed));
}

/** The edges that are meant to be smooth, by the angle between the normals of their faces; `go(join)` when one is chosen. */
export function joinsTable(joins: Join[], lengths: Lengths, go: (join: Join) => void): HTMLElement | null {
  const smooth = joins.filter((join) => join.kind === "smooth" && Number.isFinite(jumpOf(join)));
  if (!smooth.length) return null;
  const angle = (x: number | null): string => (Number.isFinite(x) ? exact(x ?? NaN, 2) : "–");
  const name = (j: Join): Child =>
    element("button", { type: "button", class: "plain", onclick: () => { go(j); } }, `edge ${j.edge}`);
  const columns: Column<Join>[] = [
    ["Edge", (j) => -j.edge, name, null],
    ["Faces", (j) => j.faces.join(" "), (j) => j.faces.join(", "), null], ["At most, °", jumpOf, (j) => angle(j.bound), "number"],
    ["Sampled, °", (j) => j.sampled ?? NaN, (j) => angle(j.sampled), "number"],
    ["Length", (j) => j.length ?? NaN, (j) => lengths.alone(j.length ?? NaN), "number rare"],
  ];
  const sharp = joins.filter((join) => join.kind === "sharp").length, open = joins.filter((join) => join.kind === "open").length;
  const others = `${sharp ? `, ${count(sharp)} sharp` : ""}${open ? `, ${count(open)} at borders` : ""}`;
  const words = `${count(smooth.length)} smooth edges${others}. `
    + "\u201CAt most\u201D holds on the whole edge, between the samples too.";
  return element("div", {}, long(sortable(smooth, columns, 2)), element("p", { class: "quiet" }, words),
    element("p", { class: "quiet paper" }, smooth.length > PRINTED ? `The first ${PRINTED} edges are printed.` : ""));
}

/** What the colours of edges mean, with how many there are of each. */
export function jumpSwatches(joins: Join[]): Swatch[] {
  const smooth = joins.filter((join) => join.kind === "smooth" && Number.isFinite(jumpOf(join)));
  const found = JUMPS.map(([limit, colour], k): Swatch => {
    const n = smooth.filter((join) => jumpClass(join) === k).length,
      text = limit === Infinity ? `over ${JUMPS[k - 1][0]}°` : `to ${limit}°`;
    return [colour, `${text}: ${count(n)}`];
  });
  const sharp = joins.filter((join) => join.kind === "sharp").length;
  if (sharp) found.push(["feature", `sharp: ${count(sharp)}`]);
  const open = joins.filter((join) => join.kind === "open").length;
  if (open) found.push(["border", `border: ${count(open)}`]);
  return found;
}
