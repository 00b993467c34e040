// The view of the report: what it draws, and what it reads out at the pointer.

import { UNUSED, blend, jumpOf, scaleColour, sub, add, Viewer, type Drawing, type Pin, type Vector } from "nurbskin-viewer";
import { finite, type Data, type Join } from "./data";
import { byId, element } from "./dom";
import { count, exact, formatter, type Lengths } from "./format";
import type { Titled } from "./legend";
import type { Marks } from "./marks";
import type { Section } from "./section";
import { STATES } from "./tables";

/** What is at a place of the view; places are in the coordinates of the file. */
export interface Place {
  kind: "point" | "surface";
  position: Vector;
  index?: number | undefined;
  deviation?: number | undefined;
  u?: number | undefined;
  v?: number | undefined;
  face?: string | undefined;
  state?: string | undefined;
  mean?: number | undefined;
  gaussian?: number | undefined;
  edge?: [string, string][] | undefined;
}

/** The mean deviation of the face of each vertex; null without deviations of several faces. */
export function byFace({ mesh, faces }: Data): Float32Array | null {
  if (!mesh?.faces || faces.length < 2 || !faces.some((face) => face.deviation?.count)) return null;
  const means = faces.map(({ deviation }) => (deviation?.count ? deviation.signed_mean ?? NaN : NaN));
  return Float32Array.from(mesh.faces, (k) => means[k]);
}

/** What is drawn. */
export function drawingOf(data: Data): Drawing {
  const { mesh, points, lines, joins, poles, bounds } = data;
  const values = (lists: Record<string, ArrayLike<number> | null>): Record<string, ArrayLike<number>> =>
    Object.fromEntries(Object.entries(lists).filter((entry): entry is [string, ArrayLike<number>] => entry[1] !== null));
  return {
    lines, joins, poles, bounds,
    mesh: mesh && {
      ...mesh,
      values: values({
        deviation: mesh.deviation, mean: mesh.mean, gaussian: mesh.gaussian, faces: mesh.faces, by_face: byFace(data),
      }),
    },
    points: points && {
      ...points,
      values: values({ deviation: points.deviation, height: points.positions.filter((_, i) => i % 3 === 2) }),
    },
  };
}

/** The view with its read-out. */
export class View {
  readonly viewer: Viewer;
  private readonly readout = byId("readout");

  /** Throws as `Viewer` does. `scale()` is that of the colours now; `chosen(k)` is told of numbered places. */
  constructor(
    private readonly data: Data, private readonly lengths: Lengths, private readonly marks: Marks, section: Section | null,
    private readonly scale: () => Titled | null, chosen: (k: number) => void,
  ) {
    const elements = { host: byId("picture"), canvas: byId<HTMLCanvasElement>("canvas"), overlay: byId<SVGSVGElement>("overlay") };
    const viewer = this.viewer = new Viewer(elements, drawingOf(data), {
      hover: (place) => {
        if (place) this.show(this.pointedAt(...place), ...place);
        else this.readout.hidden = true;
      },
      tap: (x, y) => marks.tool !== null && marks.tap(this.pick(x, y)?.position ?? null),
      key: (key) => this.key(key),
      chosen,
      drag: (distance) => { section?.shift(distance); },
      projected: (perspective) => { byId("perspective").setAttribute("aria-pressed", String(perspective)); },
    });
    viewer.setLengths(lengths);
    viewer.setPins(data.worst.map((worst, k): Pin => ({
      point: sub(worst.point, data.origin), foot: sub(worst.foot ?? worst.point, data.origin), deviation: worst.deviation,
      text: String(k + 1), chosenText: `${k + 1}: ${lengths.alone(worst.deviation, true)}`,
    })));
    section?.in(viewer);
  }

  /** Chooses a worst place and goes there; -1 for none. */
  choose(k: number): Promise<void> | undefined {
    const worst = this.data.worst.at(k);
    if (k >= 0 && worst) said(`Worst place ${k + 1}: ${this.lengths.alone(worst.deviation, true)}`);
    return this.viewer.choose(k);
  }

  /** Goes to a place of the file's coordinates and marks it. */
  visit(place: Vector): void {
    const k = this.viewer.visit(sub(place, this.data.origin));
    said(k < 0 ? `At ${place.join(", ")}` : `Worst place ${k + 1}: ${this.lengths.alone(this.data.worst[k].deviation, true)}`);
  }

  /** What is at a place of the canvas in CSS pixels: a point of the scan or a place of the surface. */
  pick(x: number, y: number): Place | null {
    const found = this.viewer.pick(x, y), { mesh, points, origin, faces } = this.data;
    if (!found) return null;
    const face = (k: number): string | undefined => (faces.length ? (k in faces && faces[k].name) || String(k) : undefined);
    const position = add(found.place, origin);
    if (found.kind === "point") {
      if (!points) return null;
      const i = found.index;
      return {
        kind: "point", index: points.index?.[i] ?? i, position, deviation: points.deviation?.[i],
        u: points.parameters?.[2 * i], v: points.parameters?.[2 * i + 1], face: points.faces ? face(points.faces[i]) : undefined,
        state: STATES[points.state[i]],
      };
    }
    if (!mesh) return null;
    const of = (list: ArrayLike<number> | null, stride = 1, offset = 0): number | undefined =>
      (list ? blend(found.on, list, stride, offset) : undefined);
    return {
      kind: "surface", position, deviation: of(mesh.deviation), u: of(mesh.parameters, 2, 0), v: of(mesh.parameters, 2, 1),
      face: mesh.faces ? face(mesh.faces[found.on.corners[0]]) : undefined, mean: of(mesh.mean), gaussian: of(mesh.gaussian),
    };
  }

  /** What is picked, with the nearest edge where the colours of edges are shown. */
  private pointedAt(x: number, y: number): Place | null {
    const found = this.pick(x, y), { mode, layers } = this.viewer.settings;
    if (!found || mode !== "jumps" || !layers.edges) return found;
    const edge = this.viewer.edgeAt(x, y, sub(found.position, this.data.origin));
    return { ...found, edge: edge === null ? undefined : edgeWords(this.data.joins.at(edge)) };
  }

  private key(key: string): boolean {
    const { viewer, marks } = this;
    if (key === "Escape" && marks.tool) marks.choose(null);
    else if (key === "Enter") {
      const place = [viewer.width / 2, viewer.height / 2] as const, found = this.pick(...place);
      this.show(found, ...place);
      said(found ? this.lines(found).map((line) => line.join(" ")).join(", ") : "Nothing in the middle of the view.");
    } else return false;
    return true;
  }

  /** A read-out as pairs of name and text. */
  private lines(found: Place): [string, string][] {
    const { data: { unit, bounds, faces }, lengths } = this, { mode } = this.viewer.settings, scale = this.scale();
    const place = formatter(bounds.diagonal, 6), parameter = formatter(1, 5), of = unit ? ` ${unit}` : "";
    const lines: [string, string][] = [found.kind === "point" ? ["Point", count(found.index)] : ["Surface", ""]];
    if (found.deviation !== undefined) {
      const none = found.kind === "point" ? "none" : "no data under it";
      lines.push(["deviation", Number.isFinite(found.deviation) ? lengths.alone(found.deviation, true) : none]);
    }
    for (const k of [0, 1, 2] as const) lines.push(["xyz".charAt(k), place(found.position[k]) + of]);
    if (Number.isFinite(found.u)) lines.push(["u, v", `${parameter(found.u)}, ${parameter(found.v)}`]);
    if (found.face !== undefined && faces.length > 1) lines.push(["face", found.face]);
    if (found.state) lines.push(["state", found.state]);
    if (found.edge) lines.push(...found.edge);
    const curvature = mode === "mean" ? found.mean : mode === "gaussian" ? found.gaussian : undefined;
    if (curvature !== undefined && scale) {
      lines.push([scale.title.toLowerCase(), `${formatter(scale.high, 3)(curvature, true)} ${scale.unit}`]);
    }
    return lines;
  }

  private show(found: Place | null, x: number, y: number): void {
    const { readout, viewer: { width, height, settings: { mode } } } = this;
    readout.hidden = !found;
    if (!found) return;
    const value = mode === "deviation" || mode === "mean" || mode === "gaussian" ? found[mode] : undefined, scale = this.scale();
    const rows = this.lines(found).map(([name, text]) => element("div", {}, element("dt", {}, name), element("dd", {}, text)));
    if (scale && finite(value)) rows[0].append(element("i", { style: `background:${scaleColour(scale, value)}` }));
    readout.replaceChildren(...rows);
    const [w, h] = [readout.offsetWidth, readout.offsetHeight];
    readout.style.left = `${Math.max(4, x + 16 + w > width ? x - w - 16 : x + 16)}px`;
    readout.style.top = `${Math.min(Math.max(4, y - h / 2), Math.max(4, height - h - 4))}px`;
  }
}

/** An edge as lines of a read-out. */
function edgeWords(join: Join | undefined): [string, string][] | undefined {
  if (!join) return undefined;
  const angle = jumpOf(join), words = `${join.bound === null ? "about" : "at most"} ${exact(angle, 2)}°`;
  const turn: [string, string] = ["normals turn by", words];
  return [["edge", `${join.edge}, ${join.kind === "open" ? "border" : join.kind ?? "several faces"}`],
    ...(Number.isFinite(angle) ? [turn] : [])];
}

/** Tells people who do not see the view. */
function said(text: string): void {
  byId("said").textContent = text;
}

/** The vertex of a face that is nearest to the middle of its vertices, in the coordinates of the file. */
export function middleOf({ mesh, origin }: Data, face: number): Vector {
  const own: Vector[] = [];
  for (let v = 0; mesh?.faces && v < mesh.faces.length; v++) {
    if (mesh.faces[v] === face) own.push([mesh.positions[3 * v], mesh.positions[3 * v + 1], mesh.positions[3 * v + 2]]);
  }
  if (!own.length) return origin;
  const mean = [0, 1, 2].map((k) => own.reduce((sum, p) => sum + p[k], 0) / own.length);
  const far = (p: Vector): number => Math.hypot(...p.map((x, k) => x - mean[k]));
  return add(own.reduce((a, b) => (far(b) < far(a) ? b : a)), origin);
}

/** Whether any point is not used, and not a duplicate, which is not drawn. */
export const anyUnused = ({ points }: Data): boolean => !!points && points.state.some((k) => k >= UNUSED && k < STATES.length - 1);
