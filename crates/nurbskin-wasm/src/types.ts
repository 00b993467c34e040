
/** Called while a computation goes on; each function may be left out. */
export interface Progress {
  /** A stage begins: read, clean, order, fit, deviation, write. `steps` is its length where it is known. */
  stage?(name: string, steps?: number): void;
  /** So many more steps of the stage are done. */
  advance?(steps: number): void;
  /** How far a stage of unknown length has come, in words. */
  tell?(text: string): void;
  /** Something the user should know; it is in the figures, too. */
  warn?(text: string): void;
  /** Return true to stop: the call then throws an error of kind "cancelled". */
  cancelled?(): boolean;
}

/** The kind of an error that is thrown; its `kind` property. */
export type ErrorKind = "read" | "write" | "invalid" | "no_solution" | "unsupported" | "cancelled";

export type UnitName = "mm" | "cm" | "m" | "um" | "in" | "ft";

/** Options of a fit, in the words of the command's options. */
export interface FitOptions {
  /** Largest distance allowed: "0.05mm", "0.1%" of the diagonal, or a number in the scan's unit. */
  tolerance?: string | number;
  /** Share of the points that must be within it, 0 to 1. */
  within?: number;
  /** Share of the surface's area that must have data, 0 to 1. */
  minCoverage?: number;
  /** Unit of the scan's numbers. */
  unit?: UnitName | "auto";
  /** Points along u in each row, and rows, of an ordered scan. */
  grid?: [number, number];
  layout?: "auto" | "single" | "network";
  /** "auto", "off", or degrees. */
  sharp?: string;
  method?: "auto" | "interpolate" | "approximate";
  topology?: "auto" | "disk" | "tube" | "sphere" | "torus";
  degree?: [number, number];
  parameters?: "auto" | "uniform" | "chord" | "centripetal";
  rarefy?: string;
  enrich?: number;
  maxControlPoints?: number;
  trim?: "auto" | "always" | "off";
  holdOut?: number;
  stepSchema?: "ap214" | "ap242";
  igesLayout?: "exact" | "paper";
  /** Whether CAD files hold the points, too. */
  withPoints?: boolean;
  author?: string;
  organization?: string;
  /** Date in the headers of files, in seconds since 1970; now, if left out. The same date gives the same bytes. */
  date?: number;
  /** A command line, shown in the report. */
  command?: string;
}

/** Options of a comparison with a CAD file. */
export interface CompareOptions {
  tolerance?: string | number;
  within?: number;
  minCoverage?: number;
  unit?: UnitName | "auto";
  /** Whether the scan is first moved to the best fit. */
  align?: boolean;
  command?: string;
}

/** Options of the virtual scanner; lengths in millimetres. */
export interface SimulateOptions {
  points?: number;
  noise?: number;
  outliers?: number;
  holes?: number;
  seed?: number;
  shuffled?: boolean;
  /** A mesh, of bodies only. */
  mesh?: boolean;
}

/** Name, size and hash of a file. */
export interface Identity { name: string; bytes: number; sha256: string }

export type Point = [number, number, number];

/** What a file holds, at a first look. */
export interface Look {
  kind: "scan" | "cad";
  name: string;
  bytes: number;
  format: string;
  unit: UnitName;
  /** "assumed" where the file does not say. */
  unitSource: "file" | "option" | "assumed";
  boundingBox: [Point, Point] | null;
  points?: number;
  triangles?: number | null;
  organisation?: "grid" | "rows" | "unordered" | "mesh";
  faces?: number;
  warnings: string[];
  scene: Scene;
}

export interface Reason { what: string; where: Point | null; next: string | null }

export interface Check {
  name: string; measured: number; limit: number; unit: string; where: Point | null; within: boolean; pass: boolean;
}

export type Verdict = "pass" | "fail" | "cannot_tell" | "not_asked";

/** Part of the figures of a fit; all keys are those of `nurbskin fit --json`. */
export interface FitFigures {
  nurbskin: string;
  schema: number;
  input: { path: string; points: number; used: number; unit: UnitName; unit_source: string; spacing: number | null; noise: number | null };
  surface: { layout: string; control_points: number[]; faces?: number; trade: { control_points: number; p95: number; max: number }[] };
  tolerance: number | null;
  deviation: { scan_to_surface: Statistics; surface_to_scan: { unsupported_area: number } };
  verdict: Verdict;
  reason: string;
  reasons: Reason[];
  check?: { verdict: string; reads_back: boolean; reasons: Reason[]; checks: Check[] };
  time: Record<string, number>;
  warnings: string[];
  details: string[];
}

export interface Statistics { count: number; max: number; mean: number; rms: number; p50: number; p95: number; p99: number; within_tolerance: number | null }

/** Part of the figures of a comparison; all keys are those of `nurbskin deviation --json`. */
export interface ComparisonFigures {
  nurbskin: string;
  input: FitFigures["input"];
  alignment: { rotation_deg: number; translation: Point; rms_before: number; rms_after: number } | null;
  tolerance: number | null;
  deviation: { scan_to_surface: Statistics; surface_to_scan: { unsupported_area: number } };
  verdict: Verdict;
  reason: string;
  reasons: Reason[];
  time: Record<string, number>;
  warnings: string[];
}

export interface Polylines { positions: Float32Array; lengths: number[] }

export interface ShownUnit { from: number; factor: number; symbol: string }

/** What a viewer draws; lengths in `unit`, positions relative to `origin`. */
export interface Scene {
  kind: "fit" | "deviation" | "view";
  title: string;
  unit: UnitName;
  shown_in: ShownUnit[];
  verdict: { verdict: Verdict; reason: string; reasons: Reason[] } | null;
  tolerance: number | null;
  within: number | null;
  tables: { title: string; rows: string[][] }[];
  details: string[];
  statistics: { scan_to_surface: Statistics } | null;
  histogram: { low: number; high: number; counts: number[]; below: number; above: number } | null;
  trade: { points: { control_points: number; p95: number; max: number }[]; chosen: number; knee: number | null; neighbours: string | null } | null;
  worst: { index: number; point: Point; foot: Point; deviation: number; u: number; v: number; face: number; state: string }[];
  bounding_box: [Point, Point];
  origin: Point;
  mesh: {
    positions: Float32Array; normals: Float32Array; triangles: Uint32Array;
    parameters: Float32Array | null; vertex_faces: Uint32Array | null;
    deviation: Float32Array | null; mean_curvature: Float32Array | null; gaussian_curvature: Float32Array | null;
  } | null;
  lines: { edges?: Polylines; seams?: Polylines; iso_curves?: Polylines; control_net?: Polylines };
  poles: Point[];
  points: {
    shown: number; total: number;
    positions: Float32Array; deviation: Float32Array | null; index: Uint32Array;
    parameters: Float32Array | null; faces: Uint32Array | null;
    /** 0 interior, 1 at a free edge, 2 held out of the fit, 3 rejected. */
    state: Uint8Array;
  } | null;
}
