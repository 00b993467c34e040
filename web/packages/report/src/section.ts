// A section: a plane through the surface, the curve in which it cuts it, and the deviation along that curve as whiskers.

import { add, dot, scaled, scaleColour, size, sub, type Scale, type Vector, type Viewer } from "nurbskin-viewer";
import type { Data, Mesh } from "./data";
import { byId, drawn, within } from "./dom";
import { count, exact, formatter, nice, percent, type Lengths } from "./format";

/** Of a plane: its normal, and the directions to the right and upwards of the drawing. */
interface Directions {
  normal: Vector;
  right: Vector;
  up: Vector;
}

type AxisName = "x" | "y" | "z";
const PLANES: Record<AxisName, Directions> = {
  x: { normal: [1, 0, 0], right: [0, 1, 0], up: [0, 0, 1] },
  y: { normal: [0, 1, 0], right: [1, 0, 0], up: [0, 0, 1] },
  z: { normal: [0, 0, 1], right: [1, 0, 0], up: [0, 1, 0] },
};

/** An end of a segment. */
interface End {
  point: Vector;
  normal: Vector | null;
  deviation: number;
}
export type Segment = [End, End];

/** Of a mesh; numbers of any type. */
interface Cuttable {
  positions: ArrayLike<number>;
  triangles: ArrayLike<number>;
  normals: ArrayLike<number> | null;
  deviation: ArrayLike<number> | null;
}

/** The segments in which a plane cuts the triangles. */
export function cutMesh(mesh: Cuttable, normal: Vector, offset: number): Segment[] {
  const { positions: p, triangles, normals, deviation } = mesh, found: Segment[] = [];
  const height = (v: number): number => normal[0] * p[3 * v] + normal[1] * p[3 * v + 1] + normal[2] * p[3 * v + 2] - offset;
  for (let t = 0; t < triangles.length; t += 3) {
    const corners = [triangles[t], triangles[t + 1], triangles[t + 2]], heights = corners.map(height);
    const over = heights.map((h) => h >= 0);
    if (over[0] === over[1] && over[1] === over[2]) continue;
    const ends: End[] = [];
    for (let k = 0; k < 3; k++) {
      const m = (k + 1) % 3;
      if (over[k] === over[m]) continue;
      // From the lower number on, so that neighbours find the same place.
      const [a, b, ha, hb] = corners[k] < corners[m]
        ? [corners[k], corners[m], heights[k], heights[m]] : [corners[m], corners[k], heights[m], heights[k]];
      const s = ha / (ha - hb);
      const at = (list: ArrayLike<number>, width: number, i: number): number => {
        const from = list[width * a + i];
        return from + s * (list[width * b + i] - from);
      };
      ends.push({
        point: [at(p, 3, 0), at(p, 3, 1), at(p, 3, 2)],
        normal: normals ? [at(normals, 3, 0), at(normals, 3, 1), at(normals, 3, 2)] : null,
        deviation: deviation ? at(deviation, 1, 0) : NaN,
      });
    }
    if (ends.length === 2) found.push([ends[0], ends[1]]);
  }
  return found;
}

/** The range of the offsets of a plane that cuts the surface. */
export function rangeAlong({ positions }: { positions: ArrayLike<number> }, normal: Vector): [number, number] {
  let low = Infinity, high = -Infinity;
  for (let i = 0; i + 2 < positions.length; i += 3) {
    const h = normal[0] * positions[i] + normal[1] * positions[i + 1] + normal[2] * positions[i + 2];
    if (h < low) low = h;
    if (h > high) high = h;
  }
  return [low, high];
}

/** The figures of the deviation along a cut, by length. */
export function alongCut(segments: Segment[]): { length: number; bare: number; mean: number; low: number; high: number } {
  let length = 0, bare = 0, sum = 0, low = Infinity, high = -Infinity;
  for (const [a, b] of segments) {
    const long = size(sub(b.point, a.point)), d = (a.deviation + b.deviation) / 2;
    length += long;
    if (Number.isFinite(d)) {
      sum += long * d;
      low = Math.min(low, a.deviation, b.deviation);
      high = Math.max(high, a.deviation, b.deviation);
    } else bare += long;
  }
  return { length, bare, mean: sum / (length - bare), low, high };
}

/** The largest 1, 2 or 5 times a power of ten with which deviations are drawn a fifteenth of the drawing long. */
export function magnification(segments: Segment[], extent: number, tolerance: number | null): number {
  const sizes = segments.flat().map(({ deviation }) => Math.abs(deviation)).filter(Number.isFinite).sort((a, b) => a - b);
  const common = Math.max(sizes.at(Math.floor(0.95 * sizes.length)) ?? 0, Math.min(tolerance ?? 0, 3 * (sizes.at(-1) ?? 0)));
  return common > 0 ? nice(extent / 15 / common) : 1;
}

/** Whiskers about this many times across the drawing. */
const WHISKERS = 110;

/** An end in the plane of the drawing; `n` is the direction of its whisker. */
interface Flat {
  x: number;
  y: number;
  d: number;
  n: [number, number] | null;
}

/** Draws a cut in its plane: the surface, the tolerance, and whiskers whose length is the deviation, `times` enlarged. */
function drawSection(into: HTMLElement, segments: Segment[], { right, up }: Directions, { scale, lengths, tolerance, times }: {
  scale: Scale | null; lengths: Lengths; tolerance: number | null; times: number;
}): { factor: number; banded: boolean } {
  const flatten = ({ point, normal, deviation }: End): Flat => {
    const [a, b] = normal ? [dot(normal, right), dot(normal, up)] : [0, 0], long = Math.hypot(a, b);
    return { x: dot(point, right), y: dot(point, up), d: deviation, n: long > 0.2 ? [a / long, b / long] : null };
  };
  const flat = segments.map(([a, b]): [Flat, Flat] => [flatten(a), flatten(b)]);
  const xs = flat.flat().map((e) => e.x), ys = flat.flat().map((e) => e.y);
  const ends = (list: number[]): [number, number] =>
    list.reduce<[number, number]>(([a, b], x) => [Math.min(a, x), Math.max(b, x)], [Infinity, -Infinity]);
  const [[x0, x1], [y0, y1]] = [ends(xs), ends(ys)], extent = Math.max(x1 - x0, y1 - y0) || 1;
  const factor = magnification(segments, extent, tolerance) * times;
  const wide = Math.max(280, Math.min(900, into.clientWidth || 640)), room = 46, tallest = 420;
  const pixel = Math.min((wide - 2 * room) / ((x1 - x0) || extent), (tallest - 2 * room) / ((y1 - y0) || extent));
  const tall = Math.max(120, (y1 - y0) * pixel + 2 * room), left = (wide - (x1 - x0) * pixel) / 2;
  const across = (x: number): string => (left + (x - x0) * pixel).toFixed(1);
  const down = (y: number): string => (tall - room - (y - y0) * pixel).toFixed(1);
  const at = (x: number, y: number): string => `${across(x)} ${down(y)}`;
  const off = (e: Flat, d: number): string | null => (e.n && Number.isFinite(d)
    ? at(e.x + factor * d * e.n[0], e.y + factor * d * e.n[1]) : null);
  const line = (of: (e: Flat) => string | null): string => flat.map(([a, b]) => [of(a), of(b)])
    .flatMap(([a, b]) => (a && b ? [`M${a}L${b}`] : [])).join("");
  const told = `Section with ${count(flat.length)} segments; whiskers are the deviation, ${exact(factor, 3)} times enlarged.`;
  const svg = drawn("svg", { viewBox: `0 0 ${wide} ${tall.toFixed(0)}`, role: "img", "aria-label": told });
  const banded = !!tolerance && factor * tolerance <= extent / 12; // or it would leave the drawing
  if (banded) for (const side of [-1, 1]) svg.append(drawn("path", { d: line((e) => off(e, side * tolerance)), class: "band" }));
  const cells = new Set<string>(), cell = extent / WHISKERS;
  for (const [a, b] of flat) {
    const e: Flat = { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, d: (a.d + b.d) / 2, n: a.n };
    const key = `${Math.floor(e.x / cell)} ${Math.floor(e.y / cell)}`;
    const tip = off(e, e.d);
    if (!tip || cells.has(key)) continue;
    cells.add(key);
    const stroke = scale ? scaleColour(scale, e.d) : "currentColor";
    svg.append(drawn("path", { d: `M${at(e.x, e.y)}L${tip}`, stroke, class: "whisker" },
      drawn("title", {}, lengths.alone(e.d, true))));
  }
  svg.append(drawn("path", { d: line((e) => off(e, e.d)), class: "tips" }),
    drawn("path", { d: line((e) => at(e.x, e.y)), class: "cut" }));
  const bar = lengths.round(90 / pixel);
  svg.append(drawn("g", { class: "ruler" }, drawn("path", { d: `M12 ${tall - 17}v5h${(bar * pixel).toFixed(1)}v-5` }),
    drawn("text", { x: 12 + bar * pixel / 2, y: tall - 20 }, lengths.alone(bar))));
  into.replaceChildren(svg);
  return { factor, banded };
}

/** What a section is now. */
export interface SectionState extends Directions {
  on: boolean;
  /** Whether what is beyond the plane is cut away. */
  away: boolean;
  plane: AxisName | "view";
  /** Place of the plane, as a share of the range and along its normal. */
  share: number;
  offset: number;
  /** Of the whiskers. */
  times: number;
}

/** The section of a view and its controls. */
export class Section {
  readonly state: SectionState = { on: false, away: true, plane: "x", ...PLANES.x, share: 0.5, offset: 0, times: 1 };
  segments: Segment[] = [];
  /** Of the whiskers. */
  scale: Scale | null = null;
  private viewer: Viewer | null = null;
  private range: [number, number] = [0, 1];
  private asked = 0;

  constructor(private readonly data: Data, private readonly mesh: Mesh, private readonly lengths: Lengths) {
    const on = (id: string, event: string, what: (of: HTMLInputElement) => void): void => {
      const of = byId<HTMLInputElement>(id);
      of.addEventListener(event, () => { what(of); });
    };
    on("section", "click", () => { this.turn(!this.state.on); });
    on("section-plane", "change", ({ value }) => { this.choose(value as SectionState["plane"]); });
    on("section-place", "input", ({ value }) => { this.place(Number(value) / 1000); });
    on("section-times", "input", ({ value }) => { this.state.times = 2 ** Number(value); this.ask(); });
    on("section-away", "change", ({ checked }) => { this.state.away = checked; this.changed(); });
    on("section-flip", "click", () => { this.flip(); });
  }

  /** The view that it is drawn in. */
  in(viewer: Viewer): void {
    this.viewer = viewer;
    this.changed();
  }

  turn(on: boolean): void {
    this.state.on = on;
    byId("section").setAttribute("aria-pressed", String(on));
    byId("section-tools").hidden = byId("section-plot").hidden = !on;
    if (on) this.choose(this.state.plane);
    else this.changed();
  }
  /** A plane by its name; `view` faces the camera. */
  choose(name: SectionState["plane"]): void {
    const axes = this.viewer?.camera.axes;
    const facing = axes ? { right: axes[0], up: axes[1], normal: axes[2] } : {};
    Object.assign(this.state, { plane: name }, name === "view" ? facing : PLANES[name]);
    byId<HTMLSelectElement>("section-plane").value = name;
    this.range = rangeAlong(this.mesh, this.state.normal);
    this.place(this.state.share);
  }
  /** What is cut away is on the other side from now on. */
  flip(): void {
    const { normal, right, share } = this.state;
    Object.assign(this.state, { normal: scaled(normal, -1), right: scaled(right, -1) });
    this.range = rangeAlong(this.mesh, this.state.normal);
    this.place(1 - share);
  }
  /** At a share of the range. */
  place(share: number): void {
    this.state.share = Math.min(Math.max(share, 0), 1);
    // Not on the very ends, nor where the vertices of a symmetric part lie.
    const [low, high] = this.range, inside = Math.min(Math.max(this.state.share, 1e-4), 1 - 1e-4) + 1.7e-5;
    this.state.offset = low + inside * (high - low);
    byId<HTMLInputElement>("section-place").value = String(Math.round(1000 * this.state.share));
    this.changed();
  }
  /** By a distance along the normal, as the handle is dragged. */
  shift(distance: number): void {
    const [low, high] = this.range;
    this.place(this.state.share + distance / ((high - low) || 1));
  }

  /** Draws it again when the browser is ready to. */
  ask(): void {
    this.asked ||= requestAnimationFrame(() => { this.asked = 0; this.draw(); });
  }

  private changed(): void {
    const { on, away, normal, offset } = this.state, { centre } = this.data.bounds;
    this.segments = on ? cutMesh(this.mesh, normal, offset) : [];
    // It is held in the middle of the cut.
    const handle = on ? { place: add(centre, normal, offset - dot(normal, centre)), normal } : null;
    this.viewer?.setSection(on ? new Float32Array(this.segments.flatMap(([a, b]) => [...a.point, ...b.point])) : null, handle);
    this.viewer?.set({ cut: on && away ? { normal, offset } : null });
    this.ask();
  }

  private draw(): void {
    if (!this.state.on) return;
    const { data, lengths, segments, scale } = this, into = byId("section-plot"), { normal, offset, plane, times } = this.state;
    const chart = within(into, ".chart"), words = within(into, "p");
    const along = offset + dot(normal, data.origin), name = plane === "view" ? "view plane" : `${plane} =`;
    const where = plane === "view" ? "" : formatter(data.bounds.diagonal, 5)(normal["xyz".indexOf(plane)] < 0 ? -along : along);
    byId("section-where").textContent = `${name} ${where}${where && data.unit ? ` ${data.unit}` : ""}`;
    if (!segments.length) {
      chart.replaceChildren();
      words.textContent = "The plane does not cut the surface.";
      return;
    }
    const { factor, banded } = drawSection(chart, segments, this.state, { scale, lengths, tolerance: data.tolerance, times });
    const { length, bare, mean, low, high } = alongCut(segments), known = Number.isFinite(mean);
    const told = [`Cut of ${lengths.alone(length)}.`];
    if (known) {
      const [least, most, average] = [low, high, mean].map((x) => lengths.alone(x, true));
      const dashed = banded ? "; dashed: the tolerance" : "";
      told.push(`Along it d is from ${least} to ${most}, ${average} on the average.`);
      told.push(`Whiskers: the deviation of the points around, ${exact(factor, 3)} times enlarged${dashed}.`);
      if (bare > 0.005 * length) told.push(`${percent(bare / length)} of it is without data.`);
    } else told.push("No deviation is known along it.");
    words.textContent = told.join(" ");
  }
}
