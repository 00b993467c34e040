// What is drawn, and the space that it takes.

import type { Join } from "./colours";
import { size, sub, type Vector } from "./vectors";

/** Polylines end to end. */
export interface Polylines {
  positions: Float32Array;
  lengths: ArrayLike<number>;
}

/** Triangles. Places are relative to the origin of the drawing. */
export interface Triangles {
  positions: Float32Array;
  /** Unit normals; facets have their own where there are none. */
  normals: Float32Array | null;
  triangles: Uint32Array;
  /** What colours can show, one number per vertex, NaN where there is none. `deviation` says where there is data at all. */
  values: Readonly<Record<string, ArrayLike<number>>>;
}

/** The first state of points that are not used, and the one that is not drawn: duplicates lie on used points. */
export const UNUSED = 3, DUPLICATE = 5;

/** Points of a scan. */
export interface Cloud {
  positions: Float32Array;
  /** Of each point: 0 interior, 1 at a free edge, 2 held out of the fit, 3 outlier, 4 in a part without a surface, 5 duplicate. */
  state: Uint8Array;
  values: Readonly<Record<string, ArrayLike<number>>>;
}

/** Kinds of lines. */
export type LineName = "edges" | "seams" | "iso_curves" | "control_net";

/** A drawing; all places are relative to one origin. */
export interface Drawing {
  mesh: Triangles | null;
  points: Cloud | null;
  lines: Partial<Record<LineName, Polylines | null>>;
  /** How the faces join at each of the edges; empty where it is not known. */
  joins: readonly Join[];
  poles: readonly Vector[];
  bounds: Bounds;
}

/** The space of a drawing. */
export interface Bounds {
  low: Vector;
  high: Vector;
  centre: Vector;
  /** Of the box of all that counts, and of the surface where there is one. */
  diagonal: number;
  size: number;
  /** Radius about the centre that holds all that is drawn. */
  reach: number;
  /** Some thousand places, relative to the centre, that a view shall hold. */
  outline: Vector[];
}

interface Box {
  low: Vector;
  high: Vector;
}
interface Places {
  positions: Float32Array;
  /** Indices of the places that count. */
  chosen: Uint32Array;
}

/** Places of the outline, from each of the sets. */
const OUTLINE = 4000;

/**
 * What a view is fitted to: the surface and the points that count, or the lines where there is neither. Points that are not
 * used do not count; beside a surface, neither do the few that lie far from most others.
 */
export function boundsOf({ mesh, points, lines }: Pick<Drawing, "mesh" | "points" | "lines">): Bounds {
  const all = Object.values(lines).filter((line) => !!line);
  const sets: Places[] = [];
  if (mesh) sets.push(placesOf(mesh.positions));
  if (points) sets.push(mesh ? bulk(points) : placesOf(points.positions, points.state));
  if (!mesh) sets.push(...all.map(({ positions }) => placesOf(positions)));
  const counted = sets.filter(({ chosen }) => chosen.length > 0), boxes = counted.map(boxOf);
  const low: Vector = [-1, -1, -1], high: Vector = [1, 1, 1];
  if (boxes.length) for (const k of [0, 1, 2] as const) {
    low[k] = Math.min(...boxes.map((box) => box.low[k]));
    high[k] = Math.max(...boxes.map((box) => box.high[k]));
  }
  const centre: Vector = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
  const diagonal = across({ low, high }), first = boxes[0];
  let reach = diagonal / 2;
  for (const p of [mesh, points, ...all].map((set) => set?.positions ?? new Float32Array())) {
    for (let i = 0; i + 2 < p.length; i += 3) {
      const r = Math.hypot((p[i] ?? 0) - centre[0], (p[i + 1] ?? 0) - centre[1], (p[i + 2] ?? 0) - centre[2]);
      if (r > reach) reach = r;
    }
  }
  const outline: Vector[] = [];
  for (const { positions: p, chosen } of counted) {
    const step = Math.max(1, Math.floor(chosen.length / OUTLINE));
    for (let k = 0; k < chosen.length; k += step) {
      const i = 3 * (chosen[k] ?? 0);
      outline.push(sub([p[i] ?? 0, p[i + 1] ?? 0, p[i + 2] ?? 0], centre));
    }
  }
  return { low, high, centre, diagonal, size: mesh && first ? across(first) : diagonal, reach, outline };
}

/** The places of a set, without the points that are not used. */
function placesOf(positions: Float32Array, state?: Uint8Array): Places {
  const count = Math.floor(positions.length / 3), chosen = new Uint32Array(count);
  let n = 0;
  for (let i = 0; i < count; i++) if (!((state?.[i] ?? 0) >= UNUSED)) chosen[n++] = i;
  return { positions, chosen: chosen.subarray(0, n) };
}

/** The box of the points that are used. */
export const boxOfPoints = ({ positions, state }: Cloud): Box => boxOf(placesOf(positions, state));

/** Points without the few that lie far from most others, or the surface beside them would shrink to a dot. */
function bulk({ positions, state }: Cloud): Places {
  const { chosen } = placesOf(positions, state), few = Math.floor(0.02 * chosen.length);
  const ends = [0, 1, 2].map((k) => {
    const sorted = new Float32Array(chosen.length);
    for (let j = 0; j < chosen.length; j++) sorted[j] = positions[3 * (chosen[j] ?? 0) + k] ?? 0;
    sorted.sort();
    return [sorted[few] ?? 0, sorted[sorted.length - 1 - few] ?? 0] as const;
  });
  const wide = Math.hypot(...ends.map(([a, b]) => b - a));
  const near = (i: number): boolean => ends.every(([a, b], k) => {
    const x = positions[3 * i + k] ?? 0;
    return x >= a - wide && x <= b + wide;
  });
  return { positions, chosen: chosen.filter(near) };
}

function boxOf({ positions, chosen }: Places): Box {
  const low: Vector = [Infinity, Infinity, Infinity], high: Vector = [-Infinity, -Infinity, -Infinity];
  for (let j = 0; j < chosen.length; j++) {
    const i = 3 * (chosen[j] ?? 0);
    for (const k of [0, 1, 2] as const) {
      const x = positions[i + k] ?? 0;
      if (x < low[k]) low[k] = x;
      if (x > high[k]) high[k] = x;
    }
  }
  return { low, high };
}

/** The diagonal of a box; 1 of a single place. */
const across = ({ low, high }: Box): number => size(sub(high, low)) || 1;

/** The segments of polylines, or of those that are wanted, by their number: six numbers each. */
export function segmentsOf(
  { positions, lengths }: Polylines, wanted: (line: number) => boolean = () => true,
): Float32Array<ArrayBuffer> {
  const found: number[] = [];
  let start = 0;
  for (let line = 0; line < lengths.length; line++) {
    const end = start + (lengths[line] ?? 0);
    if (wanted(line)) for (let k = start; k + 1 < end && 3 * k + 6 <= positions.length; k++) found.push(k);
    start = end;
  }
  const all = new Float32Array(6 * found.length);
  found.forEach((k, j) => { all.set(positions.subarray(3 * k, 3 * k + 6), 6 * j); });
  return all;
}

/** Pairs (value * weight, weight); a value that is no number weighs nothing. */
export function weighted(values: ArrayLike<number>): Float32Array<ArrayBuffer> {
  const pairs = new Float32Array(2 * values.length);
  for (let i = 0; i < values.length; i++) {
    const value = values[i] ?? NaN;
    if (!Number.isFinite(value)) continue;
    pairs[2 * i] = value;
    pairs[2 * i + 1] = 1;
  }
  return pairs;
}
