// The data of the page: JSON with lists of numbers as packed.rs writes them; document.rs describes it.

import { boundsOf, type Bounds, type Join as Joined, type LineName, type Polylines, type Vector } from "nurbskin-viewer";

/** A list of numbers: groups of one width, compressed. */
export interface Packed {
  count: number;
  width: number;
  /** What a stored integer is multiplied with; zero for integers. */
  step: number;
  /** Of the differences that are stored. */
  order: number;
  deflate: string;
}

/** A unit that lengths are shown in, from this length on: `factor` of it are one unit of the file. */
export interface ShownUnit {
  from: number;
  factor: number;
  symbol: string;
}

/** Figures of signed deviations. */
export interface Statistics {
  count: number;
  max: number;
  p99: number;
  p95: number;
  p50: number;
  mean: number;
  rms: number;
  signed_min: number;
  signed_max: number;
  signed_mean: number;
  signed_std: number;
  within_tolerance: number;
  above_tolerance: number;
  below_tolerance: number;
  unsupported_area: number;
}
export type Figures = Partial<Record<keyof Statistics, number | null>>;

export interface Reason {
  what: string;
  where: Vector | null;
  next: string | null;
}
export interface Histogram {
  low: number;
  high: number;
  counts: number[];
  below: number;
  above: number;
}
export interface TradePoint {
  control_points: number;
  p95: number;
  max: number;
}
export interface Trade {
  points: TradePoint[];
  chosen: number;
  knee: number | null;
  neighbours: string | null;
}
export interface Worst {
  index: number;
  point: Vector;
  foot: Vector | null;
  deviation: number;
  face: number;
  state: string;
}
export interface Face {
  name: string;
  kind: string;
  degree: [number, number] | null;
  control_points: [number, number] | null;
  deviation: Figures | null;
}
export interface Join extends Joined {
  edge: number;
  faces: number[];
  length: number | null;
  place: Vector | null;
}

/** All figures and texts. */
interface Texts {
  nurbskin: string | null;
  kind: string;
  title: string;
  fields: { key: string; text: string }[];
  command: string | null;
  inputs: { path: string; bytes: number | null; sha256: string | null }[];
  unit: string;
  shown_in: ShownUnit[];
  verdict: { verdict: string; reason: string | null; reasons?: Reason[] } | null;
  tolerance: number | null;
  within: number | null;
  tables: { title: string; rows: string[][] }[];
  details: string[];
  statistics: Partial<Record<Of, Figures | null>> | null;
  histogram: Histogram | null;
  trade: Trade | null;
  worst: Worst[];
  faces: Face[];
  bounding_box: [Vector, Vector] | null;
  origin: Vector;
  joins: Join[];
  poles: Vector[];
}

type MeshList =
  "positions" | "normals" | "parameters" | "vertex_faces" | "triangles" | "deviation" | "mean_curvature" | "gaussian_curvature";
type PointList = "positions" | "deviation" | "index" | "parameters" | "faces" | "state" | "not_finite";
/** What deviations are of. */
type Of = "scan_to_surface" | "all_points" | "free_edges" | "hold_out" | "surface_to_scan";

/** The data as it is in the page: what is missing has no value. */
type Raw = { [K in keyof Texts]?: Texts[K] | null } & {
  mesh?: Partial<Record<MeshList, Packed | null>> | null;
  points?: Partial<Record<PointList, Packed | null>> & { total?: number } | null;
  lines?: Partial<Record<LineName, { positions: Packed; lengths: number[] }>> | null;
};

export interface Mesh {
  positions: Float32Array<ArrayBuffer>;
  triangles: Uint32Array<ArrayBuffer>;
  normals: Float32Array<ArrayBuffer> | null;
  parameters: Float32Array<ArrayBuffer> | null;
  /** The face of each vertex. */
  faces: Uint32Array<ArrayBuffer> | null;
  deviation: Float32Array<ArrayBuffer> | null;
  mean: Float32Array<ArrayBuffer> | null;
  gaussian: Float32Array<ArrayBuffer> | null;
}
export interface Points {
  positions: Float32Array<ArrayBuffer>;
  count: number;
  /** Number of all points, of which these may be a sample. */
  total: number;
  deviation: Float32Array<ArrayBuffer> | null;
  index: Uint32Array<ArrayBuffer> | null;
  parameters: Float32Array<ArrayBuffer> | null;
  faces: Uint32Array<ArrayBuffer> | null;
  state: Uint8Array<ArrayBuffer>;
  notFinite: ArrayLike<number>;
}
/** The data as the page works with it; places of mesh, points, lines and poles are relative to `origin`. */
export interface Data extends Texts {
  mesh: Mesh | null;
  points: Points | null;
  lines: Record<LineName, Polylines | null>;
  bounds: Bounds;
}

const NONE = -0x80000000; // no number

async function inflate(text: string): Promise<Uint8Array<ArrayBuffer>> {
  const raw = atob(text), bytes = Uint8Array.from({ length: raw.length }, (_, i) => raw.charCodeAt(i));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The integers of a packed list. */
async function integersOf({ count, width, order, deflate }: Packed): Promise<Int32Array<ArrayBuffer>> {
  const n = count * width, planes = await inflate(deflate), found = new Int32Array(n);
  for (let k = 0; k < n; k++) {
    const z = planes[k] | planes[n + k] << 8 | planes[2 * n + k] << 16 | planes[3 * n + k] << 24, rest = z >>> 1 ^ -(z & 1);
    const one = order > 0 && k >= width ? found[k - width] : 0;
    found[k] = (order > 1 ? 2 * one - (k >= 2 * width ? found[k - 2 * width] : 0) : one) + rest;
  }
  return found;
}

interface List<T> {
  from(list: ArrayLike<number>, value?: (x: number) => number): T;
}

/** A packed list, as an array of the type; null without any numbers. */
export async function unpack<T>(packed: Packed | null | undefined, type: List<T>): Promise<T | null> {
  if (!packed?.count) return null;
  const whole = await integersOf(packed), { step } = packed;
  return step ? type.from(whole, (x) => (x === NONE ? NaN : step * x)) : type.from(whole);
}

/** Unit vectors of their octahedral projections. */
export async function unpackDirections(packed: Packed | null | undefined): Promise<Float32Array<ArrayBuffer> | null> {
  const flat = await unpack(packed, Float32Array);
  if (!flat) return null;
  const found = new Float32Array(flat.length / 2 * 3), sign = (x: number): number => (x < 0 ? -1 : 1);
  for (let i = 0; 2 * i < flat.length; i++) {
    let a = flat[2 * i], b = flat[2 * i + 1];
    const z = 1 - Math.abs(a) - Math.abs(b);
    if (z < 0) [a, b] = [(1 - Math.abs(b)) * sign(a), (1 - Math.abs(a)) * sign(b)];
    const long = Math.hypot(a, b, z);
    found.set([a / long, b / long, z / long], 3 * i);
  }
  return found;
}

/** The symbol of a unit as people write it: the program's own symbols do without letters that some terminals lack. */
const symbolOf = (unit: string): string => (unit === "um" ? "µm" : unit);

/** A sentence of the program with the signs of the page. */
const withSigns = (sentence: string): string => sentence.replace(/\+-(?=[\d.])/g, "±").replace(/(\d) um\b/g, "$1 µm");

/** Reads the data from the text of the page. Units and sentences of the program get the signs of the page. */
export async function readData(text: string): Promise<Data> {
  const raw = JSON.parse(text) as Raw, unit = symbolOf(raw.unit ?? "");
  const shown_in = (raw.shown_in ?? []).map((shown) => ({ ...shown, symbol: symbolOf(shown.symbol) }));
  const verdict = raw.verdict ? {
    verdict: raw.verdict.verdict, reason: raw.verdict.reason && withSigns(raw.verdict.reason),
    reasons: (raw.verdict.reasons ?? []).map(({ what, where, next }) => ({ what: withSigns(what), where, next: next && withSigns(next) })),
  } : null;
  const tables = (raw.tables ?? []).map(({ title, rows }) => ({ title, rows: rows.map((row) => row.map(withSigns)) }));
  const mesh = await readMesh(raw.mesh), points = await readPoints(raw.points);
  const line = async (name: LineName): Promise<Polylines | null> => {
    const positions = await unpack(raw.lines?.[name]?.positions, Float32Array);
    return positions ? { positions, lengths: raw.lines?.[name]?.lengths ?? [] } : null;
  };
  const lines = {
    edges: await line("edges"), seams: await line("seams"), iso_curves: await line("iso_curves"),
    control_net: await line("control_net"),
  };
  return {
    nurbskin: raw.nurbskin ?? null, kind: raw.kind ?? "", title: raw.title ?? "", fields: raw.fields ?? [],
    command: raw.command ?? null,
    inputs: raw.inputs ?? [], unit, shown_in: shown_in.length ? shown_in : [{ from: 0, factor: 1, symbol: unit }],
    verdict, tolerance: raw.tolerance ?? null, within: raw.within ?? null, tables,
    details: (raw.details ?? []).map(withSigns), statistics: raw.statistics ?? null, histogram: raw.histogram ?? null, trade: raw.trade ?? null,
    worst: raw.worst ?? [], faces: raw.faces ?? [], bounding_box: raw.bounding_box ?? null, origin: raw.origin ?? [0, 0, 0],
    joins: raw.joins ?? [], poles: raw.poles ?? [],
    mesh, points, lines,
    bounds: boundsOf({ mesh: mesh && { ...mesh, values: {} }, points: points && { ...points, values: {} }, lines }),
  };
}

async function readMesh(mesh: Raw["mesh"]): Promise<Mesh | null> {
  const positions = await unpack(mesh?.positions, Float32Array), triangles = await unpack(mesh?.triangles, Uint32Array);
  if (!mesh || !positions || !triangles) return null;
  return {
    positions, triangles,
    normals: await unpackDirections(mesh.normals),
    parameters: await unpack(mesh.parameters, Float32Array),
    faces: await unpack(mesh.vertex_faces, Uint32Array),
    deviation: await unpack(mesh.deviation, Float32Array),
    mean: await unpack(mesh.mean_curvature, Float32Array),
    gaussian: await unpack(mesh.gaussian_curvature, Float32Array),
  };
}

async function readPoints(points: Raw["points"]): Promise<Points | null> {
  const positions = await unpack(points?.positions, Float32Array);
  if (!points || !positions) return null;
  const count = positions.length / 3;
  return {
    positions, count,
    total: points.total ?? count,
    deviation: await unpack(points.deviation, Float32Array),
    index: await unpack(points.index, Uint32Array),
    parameters: await unpack(points.parameters, Float32Array),
    faces: await unpack(points.faces, Uint32Array),
    state: await unpack(points.state, Uint8Array) ?? new Uint8Array(count),
    notFinite: await unpack(points.not_finite, Uint32Array) ?? [],
  };
}

/** Whether there is a finite number. */
export const finite = (x: number | null | undefined): x is number => Number.isFinite(x);

/** The value that the share `q` of the finite magnitudes does not exceed. */
export function magnitude(values: ArrayLike<number>, q: number): number {
  const found = Float32Array.from(values, Math.abs).filter(Number.isFinite).sort();
  return found.length ? found[Math.min(found.length - 1, Math.floor(q * found.length))] : 0;
}
