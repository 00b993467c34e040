// The view of the page: a scene of the library as a drawing, and what can be chosen about it.

import type { Scene } from "nurbskin";
import {
  around, boundsOf, spread, sub, Viewer, type Drawing, type Layer, type Lengths, type Pin, type Scale, type Told, type Vector,
} from "nurbskin-viewer";
import { element } from "./dom";
import { lengthWords, roundLength } from "./words";

export const MODES = ["plain", "deviation", "zebra", "mean_curvature", "gaussian_curvature"] as const;
export type Mode = (typeof MODES)[number];

/** What can be shown or hidden, and the layers of the viewer that are it. */
export const LAYERS = {
  surface: ["surface"], points: ["points"], edges: ["edges", "features", "seams"], iso: ["iso"], net: ["net"],
} satisfies Record<string, Layer[]>;
export type Shown = keyof typeof LAYERS;

/** A marked place, in the coordinates of the file. */
export interface Marker {
  point: Vector;
  /** The nearest place of the surface, and the signed distance from it, where there is one. */
  foot?: Vector;
  deviation?: number;
  text: string;
  /** What stands beside it when it is chosen. */
  chosenText: string;
  /** What it is, for screen readers and as a tip. */
  label: string;
  kind: "worst" | "finding";
}

const EMPTY = { mesh: null, points: null, lines: {} };
const NOTHING: Drawing = { ...EMPTY, joins: [], poles: [], bounds: boundsOf(EMPTY) };

/** The viewer in the elements of the page; throws if there is no WebGL 2. */
export function openViewer(told: Told): Viewer {
  const canvas = element<HTMLCanvasElement>("canvas"), overlay = element<SVGSVGElement>("overlay");
  return new Viewer({ host: element("view"), canvas, overlay }, NOTHING, told);
}

/** A scene as the viewer draws it. */
export function drawingOf({ mesh, points, lines, poles }: Scene): Drawing {
  const present = (lists: Record<string, Float32Array | null>): Record<string, Float32Array> =>
    Object.fromEntries(Object.entries(lists).filter((entry): entry is [string, Float32Array] => entry[1] !== null));
  const shown = {
    mesh: mesh && {
      ...mesh,
      values: present({
        deviation: mesh.deviation, mean_curvature: mesh.mean_curvature, gaussian_curvature: mesh.gaussian_curvature,
      }),
    },
    points: points && { ...points, values: present({ deviation: points.deviation }) },
    lines,
  };
  return { ...shown, joins: [], poles, bounds: boundsOf(shown) };
}

/** Whether a scene has what a mode shows. */
export function hasMode({ mesh, points, kind }: Scene, mode: Mode): boolean {
  switch (mode) {
    case "plain": return true;
    case "zebra": return mesh !== null;
    case "deviation": return !!(mesh?.deviation ?? points?.deviation);
    default: return kind !== "view" && !!mesh?.[mode];
  }
}

/** Whether a scene has what a layer shows. */
export function hasLayer({ mesh, points, lines }: Scene, layer: Shown): boolean {
  const there = { surface: mesh, points, edges: lines.edges ?? lines.seams, iso: lines.iso_curves, net: lines.control_net };
  return !!there[layer];
}

/** The scale of a mode; null where it has none. Of the deviation it is the tolerance, or what 95 % of the points are within. */
export function scaleOf({ mesh, points, tolerance, statistics }: Scene, mode: Mode): Scale | null {
  if (mode === "plain" || mode === "zebra") return null;
  const limit = tolerance ?? statistics?.scan_to_surface.p95;
  if (mode === "deviation" && limit) return around(limit);
  const values = mode === "deviation" ? mesh?.deviation ?? points?.deviation : mesh?.[mode];
  return values ? spread(values) : around(1);
}

/** How far lines and points are lifted from the surface: as far as most points are off it, but neither lost in it nor loose. */
export function liftOf({ bounds }: Drawing, p99 = 0): number {
  return Math.min(Math.max(0.0015 * bounds.size, 1.2 * p99), 0.02 * bounds.size);
}

/** A marked place as the viewer has it. */
export function pinOf({ origin }: Scene, { point, foot, deviation, text, chosenText, label, kind }: Marker): Pin {
  const places = { point: sub(point, origin), foot: sub(foot ?? point, origin), deviation: deviation ?? 0 };
  return { ...places, text, chosenText, label, finding: kind === "finding" };
}

/** How the lengths of a scene are written. */
export function lengthsOf({ shown_in: units }: Scene): Lengths {
  return { alone: (x, plus) => (plus && x > 0 ? "+" : "") + lengthWords(units, x), round: (x) => roundLength(units, x) };
}
